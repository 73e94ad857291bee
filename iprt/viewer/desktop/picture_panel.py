"""The panel of the picture: the lens that it is seen through, comparisons, screenshots."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from iprt.output.tone import Curve
from iprt.viewer import labels
from iprt.viewer.desktop.ui_state import UiState
from iprt.viewer.desktop.widgets import (
    RESET_EM,
    button,
    choice,
    disabled,
    heading,
    label,
    part,
    quiet,
    slider,
)
from iprt.viewer.labels import PARTS
from iprt.viewer.lens import BUFFERS, Against, Lens

MOST_EV = 8.0
CURVES: tuple[Curve, ...] = get_args(Curve)
AGAINST: tuple[Against | None, ...] = (None, *get_args(Against))


def draw(ui: UiState) -> None:
    """The whole panel."""
    lens = ui.viewport.lens
    heading("Picture")
    lens = _exposed(lens)
    lens = _buffer(lens)
    lens = _compared(ui, lens)
    ui.viewport.lens = lens
    heading("Values")
    label("At the mouse", "What a pixel holds, in a corner of the picture (I).")
    changed, readout = imgui.checkbox("##readout", ui.readout)
    if changed:
        ui.readout = readout
    heading(PARTS["screenshot"].name)
    _screenshot(ui)


def _exposed(lens: Lens) -> Lens:
    part("exposure")
    imgui.set_next_item_width(-RESET_EM * imgui.get_font_size())
    stops = slider("##exposure", lens.exposure_ev, (-MOST_EV, MOST_EV), "{:+.2f} EV".format)
    if stops is not None:
        lens = replace(lens, exposure_ev=round(stops, 2))
    imgui.same_line()
    if button(f"{icons.ICON_FA_ROTATE_LEFT}##exposure", "Back to the scene's exposure"):
        lens = replace(lens, exposure_ev=0.0)
    part("curve")
    curve = choice("##curve", [labels.CURVES[name] for name in CURVES], CURVES.index(lens.curve))
    return lens if curve is None else replace(lens, curve=CURVES[curve])


def _buffer(lens: Lens) -> Lens:
    names = (None, *BUFFERS)
    part("buffer")
    options = [labels.PICTURE, *(labels.BUFFERS[name] for name in BUFFERS)]
    chosen = choice("##buffer", options, names.index(lens.buffer))
    return lens if chosen is None else replace(lens, buffer=names[chosen])


def _compared(ui: UiState, lens: Lens) -> Lens:
    part("against")
    problem = ui.viewport.truth_problem
    missing = {} if problem is None else {AGAINST.index("truth"): problem}
    options = [labels.NOTHING, *(labels.AGAINST[name] for name in AGAINST if name is not None)]
    chosen = choice("##against", options, AGAINST.index(lens.against), missing=missing)
    if chosen is not None:
        lens = replace(lens, against=AGAINST[chosen])
    part("error")
    with disabled(lens.against is None):
        changed, error = imgui.checkbox("##error", lens.error)
    return replace(lens, error=error) if changed else lens


def _screenshot(ui: UiState) -> None:
    about = PARTS["screenshot"].about
    half = 0.5 * (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x)
    if button(f"{icons.ICON_FA_CAMERA}  PNG", f"{about} (F12)", width=half):
        ui.screenshot(".png")
    imgui.same_line()
    if button(f"{icons.ICON_FA_CAMERA}  EXR", f"{about} (Shift+F12)", width=half):
        ui.screenshot(".exr")
    quiet(f"to {ui.folder}")
