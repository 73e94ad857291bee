"""Keys: what they do, in one table that the list of shortcuts shows too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from imgui_bundle import imgui

from iprt.viewer.desktop.desk import Desk
from iprt.viewer.desktop.gizmo import Mode

Key = imgui.Key


@dataclass(frozen=True)
class Shortcut:
    """A key and what it does.

    Attributes
    ----------
    key : str
        As it is written.
    about : str
    chords : tuple of int
        Keys with modifiers, as imgui has them. Any of them will do.
    act : callable
    """

    key: str
    about: str
    chords: tuple[int, ...]
    act: Callable[[Desk], object]


def _chord(*keys: imgui.Key) -> int:
    """Keys that are pressed together. As numbers: Python 3.11.2 cannot join these flags."""
    return sum(int(key) for key in keys)


def _mode(mode: Mode) -> Callable[[Desk], None]:
    return lambda desk: setattr(desk, "mode", mode)


def _toggle(name: str) -> Callable[[Desk], None]:
    return lambda desk: setattr(desk, name, not getattr(desk, name))


SHORTCUTS = (
    Shortcut("T", "gizmo: move", (Key.t,), _mode("move")),
    Shortcut("R", "gizmo: turn", (Key.r,), _mode("turn")),
    Shortcut("S", "gizmo: scale", (Key.s,), _mode("scale")),
    Shortcut(
        "N", "slide: turn to the surface's normal, or stay upright", (Key.n,), _toggle("align")
    ),
    Shortcut("Delete", "remove the selected object", (Key.delete,), Desk.remove),
    Shortcut("A", "add a mesh", (Key.a,), _toggle("browsing")),
    Shortcut("Ctrl+Z", "undo", (_chord(Key.mod_ctrl, Key.z),), Desk.undo),
    Shortcut(
        "Ctrl+Y",
        "redo",
        (_chord(Key.mod_ctrl, Key.y), _chord(Key.mod_ctrl, Key.mod_shift, Key.z)),
        Desk.redo,
    ),
    Shortcut("Ctrl+S", "save the scene", (_chord(Key.mod_ctrl, Key.s),), Desk.save),
    Shortcut("Space", "play or pause", (Key.space,), Desk.toggle_playing),
    Shortcut("←", "a frame back", (Key.left_arrow,), lambda desk: desk.step(-1)),
    Shortcut("→", "a frame on", (Key.right_arrow,), lambda desk: desk.step(1)),
    Shortcut("I", "values at the cursor", (Key.i,), _toggle("readout")),
    Shortcut("P", "panels", (Key.p,), _toggle("panels")),
    Shortcut("F12", "screenshot, PNG", (Key.f12,), lambda desk: desk.screenshot(".png")),
    Shortcut(
        "Shift+F12",
        "screenshot, EXR",
        (_chord(Key.mod_shift, Key.f12),),
        lambda desk: desk.screenshot(".exr"),
    ),
    Shortcut("H", "this list", (Key.h,), _toggle("help")),
    Shortcut("Esc", "close, deselect", (Key.escape,), Desk.escape),
)
ELSEWHERE = (
    ("F11", "full screen"),
    ("drag", "look around"),
    ("wheel", "field of view"),
    ("click", "select an object"),
    ("drag the selected object", "slide it over surfaces"),
    ("drop a file", "add a mesh at the cursor"),
)
"""What does not go through this table."""


def act_on_keys(desk: Desk) -> None:
    """Do what the keys that were pressed stand for, unless text is being typed."""
    if imgui.get_io().want_text_input:
        return
    for shortcut in SHORTCUTS:
        if any(imgui.is_key_chord_pressed(chord) for chord in shortcut.chords):
            shortcut.act(desk)
