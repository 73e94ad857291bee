"""Close looks at a window's picture: snapshots, ranges of values, pinned pixels."""

from __future__ import annotations

from dataclasses import replace

from iprt.viewer.picking import Readout
from iprt.viewer.ui_state import UiState

MOST_PINS = 8
STEP_EV = 0.5


def take_snapshot(ui: UiState) -> None:
    """Keep the picture with its settings and edits."""
    if ui.viewport.take_snapshot():
        ui.say("snapshot taken; B flips between it and the picture")
    else:
        ui.say("there is no picture yet", bad=True)


def flip(ui: UiState) -> None:
    """Show the snapshot in place of the picture, or the picture again."""
    viewport, lens = ui.viewport, ui.viewport.lens
    if viewport.snapshot is None:
        ui.say("first take a snapshot", bad=True)
    elif flipped(ui):
        viewport.lens = replace(lens, against=None, split=0.5)
    else:
        viewport.lens = replace(lens, against="snapshot", split=0.0, error=False)


def flipped(ui: UiState) -> bool:
    """Return True if the snapshot is shown in place of the picture."""
    lens = ui.viewport.lens
    return lens.against == "snapshot" and lens.split == 0.0 and not lens.error


def restore(ui: UiState) -> None:
    """Restore the settings and edits of the snapshot; the edits can be undone."""
    snapshot = ui.viewport.snapshot
    if snapshot is not None:
        ui.settings = snapshot.world.settings
        ui.engine.set_edits(snapshot.world)


def expose(ui: UiState, stops: float | None) -> None:
    """Change the exposure by stops, or reset it."""
    lens = ui.viewport.lens
    exposure = 0.0 if stops is None else min(max(lens.exposure_ev + stops, -8.0), 8.0)
    ui.viewport.lens = replace(lens, exposure_ev=exposure)


def flip_curve(ui: UiState) -> None:
    """Switch to the other tone curve."""
    lens = ui.viewport.lens
    ui.viewport.lens = replace(lens, curve="filmic" if lens.curve == "srgb" else "srgb")


def pin(ui: UiState, x: float, y: float) -> None:
    """Show the values of the pixel at a position in the picture from now on."""
    ui.viewport.pins = [*ui.viewport.pins, (x, y)][-MOST_PINS:]


def unpin(ui: UiState) -> None:
    """Remove all pinned pixels."""
    ui.viewport.pins = []


def pinned(ui: UiState) -> list[Readout]:
    """Return the values of the pinned pixels that the picture has."""
    found = (ui.viewport.readout(x, y) for x, y in ui.viewport.pins)
    return [values for values in found if values is not None]
