"""The desktop viewer on a device that is too slow: what is seen while pictures are on their way."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.viewer.gizmo import box_edges
from iprt.viewer.plain_video import PlainFrame
from iprt.viewer.session import Session
from tests.viewer.screen.user import SIZE, User


@pytest.fixture
def held(user: User, monkeypatch: pytest.MonkeyPatch) -> Iterator[User]:
    """A user whose device does not get on, until the test ends."""
    user.press("Scene")
    user.away()
    user.at_rest()
    released, render = threading.Event(), Session.render

    def holding(session: Session, *given: Any) -> Any:
        released.wait()
        return render(session, *given)

    monkeypatch.setattr(Session, "render", holding)
    yield user
    released.set()


def reprojected(pixels: NDArray[np.uint8], picture: View, view: View) -> NDArray[np.float64]:
    """(H, W, 3) a picture as another view has it, by bilinear interpolation; NaN beside it."""
    height, width = pixels.shape[:2]
    at = picture.project(view.directions())
    inside = (at >= 0.0).all(-1) & (at <= (width, height)).all(-1)
    at = np.where(inside[..., None], at, 0.5) - 0.5
    low = np.floor(at).astype(int)
    x, y = (at - low)[..., 0, None], (at - low)[..., 1, None]

    def texel(right: int, down: int) -> NDArray[np.float64]:
        column = np.clip(low[..., 0] + right, 0, width - 1)
        row = np.clip(low[..., 1] + down, 0, height - 1)
        return pixels[row, column].astype(np.float64)

    upper = (1 - x) * texel(0, 0) + x * texel(1, 0)
    lower = (1 - x) * texel(0, 1) + x * texel(1, 1)
    return np.where(inside[..., None], (1 - y) * upper + y * lower, np.nan)


def assert_shows_the_last_picture_turned(user: User, least: float) -> None:
    displayed = user.ui.displayed
    assert displayed is not None
    view, around = user.ui.viewport.view, user.ui.viewport.surroundings
    assert around is not None
    expected = reprojected(displayed.pixels, displayed.shown.request.view, view)
    beside = PlainFrame(around.pixels.astype(np.float32), 0, around.pose).seen(view)
    seen, known = user.picture(), np.isfinite(expected)
    assert known.mean() > least
    assert not known.all()
    difference = np.abs(seen - np.where(known, expected, beside))
    assert np.quantile(difference, 0.99) <= 2.0, "filters have 8 bits for places between texels"
    assert difference.mean() < 0.5
    assert np.abs(seen.astype(int) - displayed.pixels).mean() > 3.0, (
        "it was turned far enough to tell"
    )


def test_the_last_picture_turns_with_the_view(held: User) -> None:
    """In the drag and after it, and as the field of view changes; objects are found there."""
    cube = held.cube()
    held.move(128, 96)
    held.screen.button(1, down=True)
    for x in (150, 190):
        held.screen.move(*held.point(x, 110))
        held.wait()
        assert_shows_the_last_picture_turned(held, 0.4)
    held.screen.button(1, down=False)
    held.away()
    assert_shows_the_last_picture_turned(held, 0.4)
    displayed = held.ui.displayed
    assert displayed is not None
    held.screen.move(*held.point(128, 96))
    held.screen.wheel(-2)
    held.away()
    assert_shows_the_last_picture_turned(held, 0.3)
    direction = displayed.shown.request.view.unproject(np.array(cube))
    x, y = held.ui.viewport.view.project(direction)
    held.click(float(x), float(y))
    assert held.ui.displayed is not None
    assert held.ui.displayed.shown is displayed.shown, "no other picture has come"
    assert held.ui.selected == "cube"


def test_the_box_of_an_object_is_where_it_was_dragged_to(held: User) -> None:
    """At once, while it slides; the picture stays as it is."""
    x, y = held.cube()
    held.click(x, y)
    state = held.ui.state
    assert state is not None
    held.move(x, y - 8.0)
    held.screen.button(1, down=True)
    held.wait()
    for share in (0.5, 1.0):
        held.screen.move(*held.point(x + 40.0 * share, y - 8.0 + 12.0 * share))
        held.wait()
    displayed, dragged = held.ui.displayed, held.engine.world.edit_of("cube").to_world
    assert displayed is not None
    assert dragged is not None
    view, moved = displayed.shown.request.view, held.ui.state
    assert moved is not None
    np.testing.assert_array_equal(moved.to_world, np.reshape(dragged, (4, 4)))
    assert np.linalg.norm(moved.to_world[:3, 3] - state.to_world[:3, 3]) > 0.1
    change = np.abs(held.picture().astype(int) - displayed.pixels).max(axis=2)
    held.screen.button(1, down=False)
    held.wait()
    lines = [
        start + share * (end - start)
        for start, end in box_edges(moved, view, np.zeros(3))
        for share in np.linspace(0.0, 1.0, 50)
    ]
    inside = [p for p in lines if (p >= 2.0).all() and (p < np.array(SIZE) - 2.0).all()]
    assert len(inside) > 300
    near = [change[int(v) - 1 : int(v) + 2, int(u) - 1 : int(u) + 2].max() for u, v in inside]
    assert np.mean(np.array(near) > 12) > 0.9
