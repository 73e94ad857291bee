"""Keys of the desktop viewer, as quick as people type them and as they overlap."""

from __future__ import annotations

import time
from itertools import product

import pytest

pytest.importorskip("imgui_bundle", reason="needs the extra `view`: ./run screen")
pytest.importorskip("Xlib", reason="needs the extra `screen`: ./run screen")

from imgui_bundle import imgui

from tests.viewer.screen.user import User

pytestmark = pytest.mark.screen

OVERLAPS = {
    "one after the other": "CKkc",
    "the modifier first": "CKck",
}
"""In which order control (C) and the key (K) go down, and (c, k) up."""


def type_chord(user: User, name: str, order: str, drawn_after: int) -> None:
    """Press keys in an order; frames are drawn after so many of the four events, and at the end."""
    for number, event in enumerate(order, start=1):
        user.screen.hold({"c": "Control_L", "k": name}[event.lower()], down=event.isupper())
        if number == drawn_after:
            user.wait()
    user.wait(6)


@pytest.mark.parametrize(
    ("order", "drawn_after"),
    [pytest.param(o, n, id=f"{k}-{n}") for (k, o), n in product(OVERLAPS.items(), range(5))],
)
def test_quick_chords(user: User, order: str, drawn_after: int) -> None:
    """Ctrl+S saves, Ctrl+Z and Ctrl+Y undo and redo, whichever of their events share a frame."""
    user.at_rest()
    path = user.folder / "clip" / "scene.toml"
    text = path.read_text()
    user.engine.remove("cube")
    for name, edits in (("z", 0), ("y", 1)):
        type_chord(user, name, order, drawn_after)
        assert len(user.engine.world.edits) == edits, name
    type_chord(user, "s", order, drawn_after)
    assert user.ui.mode == "move", "Ctrl+S is not S"
    user.until(lambda: "cube" not in path.read_text())
    assert not user.ui.browsing
    path.write_text(text)
    user.until(lambda: user.shows("cube"))


def test_keys_that_are_held_down(user: User) -> None:
    """Frames go on and on; what is switched is switched once."""
    user.at_rest()
    user.screen.hold("i", down=True)
    user.until(lambda: not user.ui.readout)
    user.screen.hold("Right", down=True)
    user.until(lambda: user.ui.frame == 3)
    user.screen.hold("Right", down=False)
    user.screen.hold("Left", down=True)
    user.screen.hold("i", down=False)
    user.until(lambda: user.ui.frame == 0)
    user.screen.hold("Left", down=False)
    user.screen.hold("i", down=True)
    switched = imgui.get_io().key_repeat_delay + 4.0 * imgui.get_io().key_repeat_rate
    end = time.monotonic() + 2.0 * switched
    user.until(lambda: time.monotonic() > end)
    user.screen.hold("i", down=False)
    user.wait()
    assert user.ui.readout, "off and on again"


def test_escape_closes_what_is_open_first(user: User) -> None:
    """The colour picker of an object, and the object is let go of only then."""
    user.press("Scene")
    user.click(*user.cube())
    assert user.ui.selected == "cube"
    user.press("##color", 0.97)
    assert imgui.is_popup_open("", ANY_POPUP)
    user.key("Escape")
    assert not imgui.is_popup_open("", ANY_POPUP)
    assert user.ui.selected == "cube"
    user.key("Escape")
    assert user.ui.selected is None


ANY_POPUP = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level
