"""Several objects, snapshots and the search of settings, by keys and clicks in the window."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from iprt.geometry.material import Material
from iprt.viewer.lens import Lens
from tests.viewer.screen.user import User


@pytest.fixture(autouse=True)
def as_before(user: User) -> Iterator[None]:
    yield
    user.ui.viewport.snapshot, user.ui.viewport.pins, user.ui.search = None, [], ""
    user.ui.viewport.lens = Lens()
    user.reset()


@contextmanager
def holding(user: User, key: str) -> Iterator[None]:
    user.screen.hold(key, down=True)
    user.wait(2)
    yield
    user.screen.hold(key, down=False)
    user.wait(2)


def names(user: User) -> set[str]:
    return {state.name for state in user.engine.objects}


def test_objects_are_copied_grouped_removed_and_brought_back(user: User) -> None:
    first = user.cube()
    user.click(*first)
    user.key("d", control=True)
    user.until(lambda: names(user) == {"cube", "cube-2"})
    user.at_rest()
    assert user.ui.selection.names == ("cube-2",)
    with holding(user, "Control_L"):
        user.click(*first)
    assert user.ui.selection.names == ("cube-2", "cube")
    user.key("g", control=True)
    user.until(lambda: all(state.group == "group" for state in user.engine.objects))
    user.at_rest()
    user.key("Escape")
    assert user.ui.selection.names == ()
    user.click(*first)
    assert set(user.ui.selection.names) == {"cube", "cube-2"}
    user.key("k")
    user.until(lambda: all(state.locked for state in user.engine.objects))
    user.key("Delete")
    assert user.reads("cube is locked")
    user.key("k")
    user.until(lambda: not any(state.locked for state in user.engine.objects))
    user.key("Delete")
    user.until(lambda: names(user) == set())
    user.key("z", control=True)
    user.until(lambda: names(user) == {"cube", "cube-2"})


def test_a_snapshot_is_flipped_and_taken_back(user: User) -> None:
    user.at_rest()
    before = user.picture()
    user.key("c")
    assert user.reads("snapshot taken")
    user.engine.editor.paint({"cube": Material("plastic", (0.1, 0.6, 0.2), alpha=0.3)})
    user.at_rest()
    user.until(lambda: user.ui.notice is None)
    user.wait()
    assert not np.array_equal(user.picture(), before)
    user.key("b")
    user.at_rest()
    assert user.ui.viewport.lens.against == "snapshot"
    displayed = user.ui.displayed
    assert displayed is not None
    snapshot = user.ui.viewport.snapshot
    assert snapshot is not None
    pixels = user.ui.viewport.lens.develop(snapshot.picture.color, user.engine.scene.exposure)
    np.testing.assert_array_equal(displayed.pixels, pixels)
    user.key("b")
    user.key("b", control=True)
    user.until(lambda: not user.engine.world.edits)


def test_pixels_are_pinned(user: User) -> None:
    user.at_rest()
    with holding(user, "Shift_L"):
        user.click(40.0, 60.0)
    ((x, y),) = user.ui.viewport.pins
    width, height = user.app.picture_view.rectangle[2:]
    assert (x * width, y * height) == pytest.approx((40.0, 60.0), abs=1.0)
    assert user.ui.selected is None


def test_settings_are_found_by_words(user: User) -> None:
    user.press("Settings")
    user.ui.search = "caustic"  # as if it was typed
    user.away()
    user.until(lambda: user.reads("caustic clamp"))
    user.ui.search = "nothing has this"
    user.away()
    user.until(lambda: user.reads("No setting has these words."))
    user.press("Scene")


def test_all_keys_are_listed(user: User) -> None:
    user.at_rest()
    user.key("F1")
    user.until(lambda: user.reads("look around"))
    user.key("F1")
    user.until(lambda: not user.reads("look around"))
