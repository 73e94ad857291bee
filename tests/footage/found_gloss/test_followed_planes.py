"""Gloss in a video: a camera that moves tells a reflection from the texture that it lies on."""

from __future__ import annotations

import pytest

from iprt.footage.found_gloss.search import find_gloss
from iprt.footage.frame import Frame
from tests.footage.moving_rooms import seen

ALPHA, CONTRAST, ROWS = 0.1, 0.8, 96
CAMERA = [((0.01, 0.0, 0.0), 0.0), ((0.5, 0.1, 0.2), 10.0), ((-0.5, 0.0, 0.3), -20.0)]
BALL = [(-1.2, -1.6), (-0.5, -1.5), (0.2, -1.4)]


def carried(alpha: float | None) -> list[Frame]:
    """The camera moves and turns in a still room."""
    return [
        seen(alpha, CONTRAST, camera=place, yaw_deg=yaw_deg, rows=ROWS) for place, yaw_deg in CAMERA
    ]


@pytest.mark.thorough
def test_a_moving_camera_finds_the_gloss_of_a_patterned_floor() -> None:
    first, *later = carried(ALPHA)
    assert find_gloss(first).found == ()
    (floor,) = find_gloss(first, later=later).found
    assert floor.name == "floor"
    assert ALPHA / 2.0 < floor.material.alpha < 2.0 * ALPHA


@pytest.mark.thorough
def test_a_moving_camera_finds_nothing_on_a_matte_floor() -> None:
    first, *later = carried(None)
    assert find_gloss(first, later=later).found == ()


@pytest.mark.thorough
def test_what_things_change_that_move_is_no_evidence() -> None:
    """Their shadows are like rough reflections, so that frames of a still camera are left out."""
    first, *later = (seen(None, CONTRAST, ball, rows=ROWS) for ball in BALL)
    assert find_gloss(first, later=later).found == find_gloss(first).found == ()
