"""Actions of the user in both viewers, with their buttons and keys.

This module does not draw: `desktop.widgets.action_button` and `web.inputs.Inputs` do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from iprt.scene.material_maps import MAPS
from iprt.viewer.labels import PARTS, Label
from iprt.viewer.looking import (
    STEP_EV,
    expose,
    flip,
    flip_curve,
    restore,
    take_snapshot,
    unpin,
)
from iprt.viewer.ui_state import UiState


@dataclass(frozen=True)
class Action:
    """An action with its button and keys.

    Attributes
    ----------
    name : str
        Name, unique in a window.
    label : Label
    act : callable
    keys : str
        Keys as on the keyboard, `Ctrl+Z`; alternatives are separated by a comma.
    repeats : bool
        True if holding the key repeats the action.
    enabled, visible : callable
        Return True if the button is usable, or shown, now.
    """

    name: str
    label: Label
    act: Callable[[], object]
    keys: str = ""
    repeats: bool = False
    enabled: Callable[[], bool] = lambda: True
    visible: Callable[[], bool] = lambda: True

    @property
    def hint(self) -> str:
        """Text of the button's tooltip."""
        keys = f" ({self.keys})" if self.keys else ""
        return f"{self.label.name}{keys}. {self.label.about}"


def actions(ui: UiState) -> dict[str, Action]:
    """Return the actions that both viewers have, by name."""
    engine, selection = ui.engine, ui.selection

    def textured() -> bool:
        state = ui.state
        material = None if state is None or state.light is not None else state.materials[0]
        return material is not None and (material.textured or material.has_holes)

    def bare() -> None:
        selection.paint(**dict.fromkeys(MAPS), variants=None, opacity=1.0, cutoff=0.0)

    def selected() -> bool:
        return ui.state is not None

    def grouped() -> bool:
        return any(state.group for state in selection.states)

    def lock() -> None:
        selection.lock(not all(state.locked for state in selection.states))

    def on_selected(name: str, keys: str, act: Callable[[], object], **more: Any) -> Action:
        return Action(name, PARTS[name], act, keys, visible=selected, **more)

    def show_all() -> None:
        ui.show([state.name for state in engine.objects], True)

    found = (
        Action(
            "undo",
            PARTS["undo"],
            lambda: ui.go_back(engine.undo),
            "Ctrl+Z",
            repeats=True,
            enabled=lambda: engine.can_undo,
        ),
        Action(
            "redo",
            PARTS["redo"],
            lambda: ui.go_back(engine.redo),
            "Ctrl+Y, Ctrl+Shift+Z",
            repeats=True,
            enabled=lambda: engine.can_redo,
        ),
        Action("save", PARTS["save"], ui.save, "Ctrl+S", enabled=lambda: bool(engine.unsaved)),
        Action("select all", PARTS["select all"], selection.select_all, "Ctrl+A"),
        on_selected("duplicate", "Ctrl+D", ui.duplicate),
        on_selected("copy", "Ctrl+C", ui.copy),
        Action("paste", PARTS["paste"], ui.paste, "Ctrl+V"),
        on_selected("settle", "End", lambda: selection.settle(align=ui.align)),
        on_selected("lock", "K", lock),
        on_selected("hide", "H", lambda: ui.show(selection.names, False)),
        Action("show all", PARTS["show all"], show_all, "Shift+H"),
        on_selected("group", "Ctrl+G", selection.group, enabled=lambda: len(selection.names) > 1),
        on_selected("ungroup", "Ctrl+Shift+G", selection.ungroup, enabled=grouped),
        on_selected("array", "", lambda: selection.array(ui.array_count, ui.array_step)),
        on_selected("remove", "Delete", selection.remove),
        Action("light", PARTS["add light"], ui.add_light, "L"),
        *_looking(ui),
        Action("bare", PARTS["bare"], bare, visible=textured),
        Action("play", PARTS["play"], ui.toggle_playing, "Space"),
    )
    return {action.name: action for action in found}


def _looking(ui: UiState) -> tuple[Action, ...]:
    """Return the actions that look closely at the picture."""
    viewport = ui.viewport

    def taken() -> bool:
        return viewport.snapshot is not None

    def on_snapshot(name: str, act: Callable[[], object], keys: str) -> Action:
        return Action(name, PARTS[name], act, keys, enabled=taken)

    def auto_range() -> None:
        viewport.lens = viewport.lens.ranged(None, None)

    def ranged() -> bool:
        return (viewport.lens.low, viewport.lens.high) != (None, None)

    def pins() -> bool:
        return bool(viewport.pins)

    return (
        Action("snapshot", PARTS["snapshot"], lambda: take_snapshot(ui), "C"),
        on_snapshot("flip", lambda: flip(ui), "B"),
        on_snapshot("back to snapshot", lambda: restore(ui), "Ctrl+B"),
        Action("brighter", PARTS["brighter"], lambda: expose(ui, STEP_EV), "E", repeats=True),
        Action("darker", PARTS["darker"], lambda: expose(ui, -STEP_EV), "Shift+E", repeats=True),
        Action("reset exposure", PARTS["reset exposure"], lambda: expose(ui, None), "0"),
        Action("flip curve", PARTS["flip curve"], lambda: flip_curve(ui), "F"),
        Action("auto range", PARTS["auto range"], auto_range, visible=ranged),
        Action("unpin", PARTS["unpin"], lambda: unpin(ui), "Shift+U", visible=pins),
    )


def offer_actions(ui: UiState) -> tuple[Action, ...]:
    """Return the answers to the offer of unsaved edits that an earlier viewer left."""
    autosaver = ui.engine.autosaver
    acts = {"restore": autosaver.restore, "discard": autosaver.discard, "later": autosaver.postpone}
    return tuple(Action(name, PARTS[name], act) for name, act in acts.items())
