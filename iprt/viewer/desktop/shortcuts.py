"""Keyboard shortcuts, which the help shows too."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from imgui_bundle import imgui

from iprt.viewer.actions import Action, actions
from iprt.viewer.desktop.ui_state import DesktopState
from iprt.viewer.desktop.window import KeyPress
from iprt.viewer.labels import Label
from iprt.viewer.timeline_fields import timeline_actions

ELSEWHERE = (
    ("F11", "full screen"),
    ("drag", "look around"),
    ("wheel", "field of view"),
    ("click", "select an object"),
    ("Ctrl+click", "select several objects"),
    ("Shift+click", "pin the values of a pixel"),
    ("drag an object", "slide the selected one over surfaces"),
    ("drag a key", "move it; with Ctrl, a copy"),
    ("double-click", "timeline: go to the frame"),
    ("right-click a key", "linear, smooth or step"),
    ("drop a file", "add a mesh at the cursor"),
)
"""Inputs that are handled elsewhere."""


def shortcuts(ui: DesktopState) -> tuple[Action, ...]:
    """Return all actions with keys."""
    shared = actions(ui)

    def key(keys: str, about: str, act: Callable[[], object], *, repeats: bool = False) -> Action:
        return Action(keys, Label(about, ""), act, keys, repeats)

    def put(name: str, value: object) -> Callable[[], None]:
        return lambda: setattr(ui, name, value)

    def toggle(name: str) -> Callable[[], None]:
        return lambda: setattr(ui, name, not getattr(ui, name))

    return (
        key("T", "gizmo: move", put("mode", "move")),
        key("R", "gizmo: turn", put("mode", "turn")),
        key("S", "gizmo: scale", put("mode", "scale")),
        key("N", "slide: turn to the surface's normal, or stay upright", toggle("align")),
        key("X", "gizmo: in steps", toggle("stepped")),
        key("F2", "rename the selected object", put("renaming", True)),
        key("A", "add a mesh", ui.browse),
        *(action for action in (*timeline_actions(ui).values(), *shared.values()) if action.keys),
        key("←", "a frame back", lambda: ui.step(-1), repeats=True),
        key("→", "a frame on", lambda: ui.step(1), repeats=True),
        key("V", "values at the cursor", toggle("readout")),
        key("P", "panels", toggle("panels")),
        key("F12", "screenshot, PNG", lambda: ui.screenshot(".png")),
        key("Shift+F12", "screenshot, EXR", lambda: ui.screenshot(".exr")),
        key("Ctrl+R", "render to a file", ui.open_renders),
        key("?, F1", "this list", toggle("help")),
        key("Esc", "close, deselect", lambda: _escape(ui)),
    )


def act_on_keys(ui: DesktopState, presses: Sequence[KeyPress]) -> None:
    """Run the actions of pressed keys, unless text is being typed."""
    if imgui.get_io().want_text_input:
        return
    for press in presses:
        for action in shortcuts(ui):
            held = press.repeated and not action.repeats
            if press.keys in action.keys.split(", ") and action.enabled() and not held:
                action.act()
                break  # keys are deleted rather than their objects


def _escape(ui: DesktopState) -> None:
    """Close an open list or color picker, or else another open part."""
    flags = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level
    if imgui.is_popup_open("", flags):
        imgui.internal.close_popups_except_modals()
    else:
        ui.escape()
