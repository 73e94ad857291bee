"""The timeline of the window: keys that are set, dragged, copied and deleted by the mouse."""

from __future__ import annotations

import time

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.viewer.desktop.style import ACCENT
from iprt.viewer.history import GESTURE_S
from tests.viewer.screen.user import User

MOVED = (-0.6, 0.3, 0.0)
"""Metres."""


def keys(user: User) -> list[int]:
    """Frames of the keys of the cube."""
    row = user.ui.timeline.primary
    assert row is not None
    return [round(user.ui.timeline.frame_of(key.time)) for key in row.keys]


def place(user: User, frame: int) -> NDArray[np.float64]:
    """Where the cube is then."""
    user.engine.seek(frame)
    user.at_rest()
    return user.engine.objects[0].pivot


def on_strip(user: User, frame: int, row: int = 0) -> tuple[float, float]:
    """The point of a frame on a row of keys, from the corner of the picture."""
    strip = user.app.timeline
    _, y = next(place for key, place in strip.places.items() if key[0] == bool(row))
    left, top = user.app.picture_view.rectangle[:2]
    return strip._axis.x(frame) - left, y - top


@pytest.fixture
def animated(user: User) -> User:
    """Before a cube that keys in frames 0 and 3 move."""
    user.click(*user.cube())
    user.key("i")
    user.press("\uf111##record")
    assert user.ui.selection.recording
    for _ in range(3):
        user.key("Right")
    user.at_rest()
    state = user.ui.state
    assert state is not None
    user.ui.selection.place(state, _moved(state.to_world))
    user.press("\uf111##record")
    assert not user.ui.selection.recording
    user.at_rest()
    assert keys(user) == [0, 3]
    return user


def _moved(to_world: NDArray[np.float64]) -> NDArray[np.float64]:
    moved = to_world.copy()
    moved[:3, 3] += MOVED
    return moved


def test_a_dragged_key_moves_the_object_in_time(animated: User) -> None:
    """By whole frames; one that is dragged with Ctrl leaves a copy."""
    user, start, end = animated, place(animated, 0), place(animated, 3)
    np.testing.assert_allclose(end - start, MOVED, atol=1e-6)
    user.drag(on_strip(user, 3), on_strip(user, 1))
    assert keys(user) == [0, 1]
    np.testing.assert_allclose(place(user, 1), end, atol=1e-6)
    user.screen.hold("Control_L", down=True)
    user.drag(on_strip(user, 0), on_strip(user, 2))
    user.screen.hold("Control_L", down=False)
    user.wait()
    assert keys(user) == [0, 1, 2]
    np.testing.assert_allclose(place(user, 2), start, atol=1e-6)
    user.drag(on_strip(user, 2), on_strip(user, 1))
    assert keys(user) == [0, 1, 2]
    assert user.ui.notice is not None
    assert "there is a key at" in user.ui.notice[0]


def test_clicks_choose_delete_and_interpolate(animated: User) -> None:
    user = animated
    time.sleep(GESTURE_S)
    user.click(*on_strip(user, 3))
    assert [key[2] for key in user.ui.timeline.chosen] == [user.ui.timeline.time_of(3)]
    user.key("Delete")
    assert keys(user) == [0]
    assert user.ui.selected == "cube"
    user.key("z", control=True)
    user.at_rest()
    assert keys(user) == [0, 3]
    user.move(*on_strip(user, 0))
    for down in (True, False):
        user.screen.button(3, down=down)
        user.wait(2)
    user.press("Smooth")
    row = user.ui.timeline.primary
    assert row is not None
    assert row.keys[0].interpolation == "smooth"
    user.move(*on_strip(user, 2))
    for down in (True, False) * 2:
        user.screen.button(1, down=down)
    user.wait(8)
    assert user.ui.frame == 2
    assert not user.ui.timeline.chosen
    user.key("Delete")
    user.at_rest()
    assert not user.engine.objects, "without chosen keys the object is removed"


def test_the_path_is_drawn_to_where_the_object_goes(animated: User) -> None:
    """From key to key, also while the video rests at another frame."""
    user, view = animated, animated.at_rest().request.view
    places = [view.project(place(user, frame)) for frame in (0, 3)]
    user.engine.seek(0)
    user.at_rest()

    def lit() -> float:
        """Share of the upper half of the path in its color."""
        picture = user.picture().astype(int)
        found = []
        for share in np.linspace(0.55, 0.95, 20):
            x, y = places[0] + share * (places[1] - places[0])
            near = picture[round(y), round(x) - 2 : round(x) + 3]
            found.append(np.abs(near - 255.0 * np.array(ACCENT[:3])).max(axis=1).min() < 70)
        return float(np.mean(found))

    assert lit() > 0.9
    user.key("Escape")
    assert lit() < 0.1


def test_keys_of_the_view(user: User) -> None:
    """Without a selection the key is the view's; playing then follows it."""
    user.at_rest()
    user.key("i")
    before = user.ui.viewport.view
    user.engine.seek(3)
    user.drag((128, 96), (98, 96))
    assert user.ui.viewport.name is None
    turned = user.ui.viewport.view
    user.key("i")
    assert user.ui.viewport.name == "ahead"
    shown = user.at_rest()
    assert shown.request.view.yaw_deg == pytest.approx(turned.yaw_deg, abs=1e-3)
    user.engine.seek(0)
    shown = user.at_rest()
    assert shown.request.view.yaw_deg == pytest.approx(before.yaw_deg, abs=1e-3)
    user.drag(on_strip(user, 3, row=1), on_strip(user, 1, row=1))
    user.engine.seek(1)
    shown = user.at_rest()
    assert shown.request.view.yaw_deg == pytest.approx(turned.yaw_deg, abs=1e-3)
