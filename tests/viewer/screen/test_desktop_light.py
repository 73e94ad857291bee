"""The panel of light in the desktop viewer, and the arrow of the sun."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.footage.video.video_table import SunTable
from iprt.scene.scene import Scene
from iprt.viewer.desktop.gizmo import GIZMO
from iprt.viewer.sun_arrow import COLOR, SunArrow
from tests.viewer.screen.user import User


@pytest.fixture
def sunny(user: User) -> User:
    """Before the panel of light, with a sun that was set by hand."""
    open_panel(user)
    choose(user, "Set by hand")
    assert isinstance(user.engine.video.sun, SunTable)
    user.at_rest()
    return user


def open_panel(user: User) -> None:
    user.press("Light")
    scroll(user, 50)


def scroll(user: User, steps: int) -> None:
    """Turn the wheel over the panel; positive steps lead to its upper end."""
    user.move(user.app.picture_view.rectangle[2] + 100.0, 100.0)
    user.screen.wheel(steps)
    user.wait(6)


def choose(user: User, name: str) -> None:
    """Choose which sun there is."""
    user.press("##sun")
    user.press(name)
    user.away()


def colored(user: User) -> int:
    """Pixels of the picture in the color of the arrow."""
    difference = np.abs(user.picture().astype(int) - COLOR).max(axis=2)
    return int((difference < 12).sum())


def arrow_of(user: User) -> SunArrow:
    arrow = user.ui.arrow(user.at_rest().request.view)
    assert arrow is not None
    return arrow


def test_the_sun_is_an_arrow_that_is_dragged(sunny: User) -> None:
    """By a ring around its point; the whole drag is undone at once."""
    before = colored(sunny)
    sunny.press("##arrow")
    sunny.away()
    sunny.at_rest()
    assert colored(sunny) > before + 100
    arrow, view = arrow_of(sunny), sunny.at_rest().request.view
    middle = view.project(arrow.point)
    turn = 2.0 * np.pi * np.arange(24) / 24
    around = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    grips = (middle + radius * way for radius in range(8, 40, 2) for way in around)
    x, y = next((x, y) for x, y in grips if over_ring(sunny, x, y))
    sunny.drag((x, y), (x + 16.0, y))
    after = sunny.engine.sun
    assert after is not None
    assert np.abs(after.direction - arrow.towards).max() > 0.05
    assert sunny.ui.selection.sun
    assert sunny.at_rest().request.view == view, "the view has not turned"
    np.testing.assert_array_equal(arrow_of(sunny).point, arrow.point)
    sunny.key("z", control=True)
    undone = sunny.engine.sun
    assert undone is not None
    np.testing.assert_allclose(undone.direction, arrow.towards, atol=1e-3)
    sunny.click(20.0, 150.0)
    assert not sunny.ui.selection.sun, "a click beside deselects it"


def over_ring(user: User, x: float, y: float) -> bool:
    """Whether the ring about the vertical is there."""
    user.move(float(x), float(y))
    ring = GIZMO.get_hovered_handle_type() == GIZMO.MOVETYPE.mt_rotate_y
    return bool(GIZMO.is_over() and ring)


def test_numbers_of_the_sun(sunny: User) -> None:
    """Sliders have words for their values, and are grey without a sun."""
    sunny.press("##sun_pitch", 0.5)
    sunny.away()
    sun = sunny.engine.sun
    assert sun is not None
    assert abs(np.rad2deg(np.arcsin(sun.direction[1]))) < 45.0
    height = f"sun: {np.rad2deg(np.arcsin(sun.direction[1])):.1f} degrees high"
    scroll(sunny, -50)
    sunny.until(lambda: sunny.reads(height, "declared"))
    scroll(sunny, 50)
    choose(sunny, "None")
    assert sunny.engine.sun is None
    sunny.press("##sun_pitch", 0.9)
    assert sunny.engine.video.sun == "none"
    scroll(sunny, -50)
    assert not sunny.reads("degrees high")


def test_switches_are_saved(user: User) -> None:
    path = user.folder / "clip" / "scene.toml"
    text = path.read_text()
    open_panel(user)
    user.at_rest()
    for key in ("gloss", "sky"):
        user.press(f"##{key}")
    choose(user, "None")
    assert user.engine.unsaved == ("gloss", "sun", "sky")
    user.key("s", control=True)
    user.until(lambda: not user.engine.unsaved)
    video = Scene.open(user.folder / "clip").manifest.video
    assert (video.gloss, video.sun, video.sky) == ("declared", "none", "none")
    path.write_text(text)
    user.until(lambda: user.engine.video.gloss == "auto")
    user.at_rest()
    user.press("Scene")
