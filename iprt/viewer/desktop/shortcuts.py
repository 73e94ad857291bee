"""The table of keyboard shortcuts, which the help shows too."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from imgui_bundle import imgui

from iprt.viewer.desktop.gizmo import Mode
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.window import KeyPress


@dataclass(frozen=True)
class Shortcut:
    """A keyboard shortcut with its action.

    Attributes
    ----------
    keys : str
        Names as in `KeyPress`; alternatives are separated by a comma.
    about : str
    act : callable
    repeats : bool
        True if holding the key repeats the action.
    """

    keys: str
    about: str
    act: Callable[[DesktopState], object]
    repeats: bool = False


def _mode(mode: Mode) -> Callable[[DesktopState], None]:
    return lambda ui: setattr(ui, "mode", mode)


def _toggle(name: str) -> Callable[[DesktopState], None]:
    return lambda ui: setattr(ui, name, not getattr(ui, name))


SHORTCUTS = (
    Shortcut("T", "gizmo: move", _mode("move")),
    Shortcut("R", "gizmo: turn", _mode("turn")),
    Shortcut("S", "gizmo: scale", _mode("scale")),
    Shortcut("N", "slide: turn to the surface's normal, or stay upright", _toggle("align")),
    Shortcut("Delete", "remove the selected object", DesktopState.remove),
    Shortcut("A", "add a mesh", DesktopState.browse),
    Shortcut("Ctrl+Z", "undo", lambda ui: ui.engine.undo(), repeats=True),
    Shortcut("Ctrl+Y, Ctrl+Shift+Z", "redo", lambda ui: ui.engine.redo(), repeats=True),
    Shortcut("Ctrl+S", "save the scene", DesktopState.save),
    Shortcut("Space", "play or pause", DesktopState.toggle_playing),
    Shortcut("←", "a frame back", lambda ui: ui.step(-1), repeats=True),
    Shortcut("→", "a frame on", lambda ui: ui.step(1), repeats=True),
    Shortcut("I", "values at the cursor", _toggle("readout")),
    Shortcut("P", "panels", _toggle("panels")),
    Shortcut("F12", "screenshot, PNG", lambda ui: ui.screenshot(".png")),
    Shortcut("Shift+F12", "screenshot, EXR", lambda ui: ui.screenshot(".exr")),
    Shortcut("H", "this list", _toggle("help")),
    Shortcut("Esc", "close, deselect", lambda ui: _escape(ui)),
)
ELSEWHERE = (
    ("F11", "full screen"),
    ("drag", "look around"),
    ("wheel", "field of view"),
    ("click", "select an object"),
    ("drag the selected object", "slide it over surfaces"),
    ("drop a file", "add a mesh at the cursor"),
)
"""Inputs that are handled elsewhere."""


def act_on_keys(ui: DesktopState, presses: Sequence[KeyPress]) -> None:
    """Run the actions of pressed keys, unless text is being typed."""
    if imgui.get_io().want_text_input:
        return
    for press in presses:
        for shortcut in SHORTCUTS:
            if press.keys in shortcut.keys.split(", ") and (shortcut.repeats or not press.repeated):
                shortcut.act(ui)


def _escape(ui: DesktopState) -> None:
    """Close an open list or colour picker, or else another open part."""
    flags = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level
    if imgui.is_popup_open("", flags):
        imgui.internal.close_popups_except_modals()
    else:
        ui.escape()
