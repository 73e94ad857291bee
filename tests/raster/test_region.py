"""Rectangles around boxes hold everything that the boxes can touch."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.raster.region import Rect, box_corners, box_rects, merge

VIEWS = [
    View(320, 160, projection="equirect"),
    View(321, 161, yaw_deg=70.0, pitch_deg=40.0, projection="equirect"),
    View(200, 150, yaw_deg=-20.0, pitch_deg=15.0, fov_y_deg=60.0),
    View(90, 200, yaw_deg=170.0, pitch_deg=-70.0, fov_y_deg=120.0),
]


def covered(view: View, rects: list[Rect]) -> np.ndarray:
    mask = np.zeros((view.height, view.width), int)
    for rect in rects:
        mask[rect.pixels] += 1
    return mask


@pytest.mark.parametrize("view", VIEWS)
def test_boxes_stay_inside(view: View) -> None:
    """Random boxes: near, far, over poles and seam, around and behind the camera."""
    rng = np.random.default_rng(5)
    partial = 0
    for _ in range(300):
        centre = rng.normal(size=3) * rng.choice([0.3, 2.0, 10.0])
        half = rng.random(3) * rng.choice([0.05, 0.5, 2.0])
        matrix = rng.normal(size=(3, 3))
        corners = box_corners(-half, half) @ matrix.T + centre
        mask = covered(view, box_rects(view, corners))
        partial += 0 < mask.mean() < 0.5
        points = (rng.random((4000, 3)) * 2.0 - 1.0).clip(-1, 1)
        points[np.arange(2000), rng.integers(0, 3, 2000)] = rng.choice([-1, 1], 2000)
        image = view.project((points * half) @ matrix.T + centre)
        pixel = np.floor(image[np.isfinite(image).all(axis=1)])
        inside = (pixel >= 0).all(axis=1) & (pixel < [view.width, view.height]).all(axis=1)
        x, y = pixel[inside].astype(int).T
        assert mask[y, x].all()
    assert partial > 25


def test_bounds_are_tight() -> None:
    """A small far box takes few pixels; at the seam it is split, not stretched."""
    view = VIEWS[0]
    for place in ([0, 0, -5], [0, 0, 5]):
        corners = box_corners(np.full(3, -0.2), np.full(3, 0.2)) + place
        rects = box_rects(view, corners)
        assert covered(view, rects).sum() < 200
        assert len(rects) == (1 if place[2] < 0 else 2)
    assert box_rects(VIEWS[2], corners) == []


def test_around_the_camera_takes_all() -> None:
    for view in VIEWS:
        (rect,) = box_rects(view, box_corners(np.full(3, -1.0), np.full(3, 2.0)))
        assert rect.viewport == (0, 0, view.width, view.height)


def test_merge_is_disjoint_and_complete() -> None:
    rng = np.random.default_rng(6)
    view = View(60, 60)
    for _ in range(100):
        low = rng.integers(0, 50, (6, 2))
        size = rng.integers(1, 12, (6, 2))
        rects = [
            Rect(x, y, min(x + w, 60), min(y + h, 60))
            for (x, y), (w, h) in zip(low, size, strict=True)
        ]
        merged = covered(view, merge(rects))
        assert merged.max() == 1
        assert (merged >= np.minimum(covered(view, rects), 1)).all()


def test_tiles_partition() -> None:
    mask = covered(View(50, 40), Rect(3, 5, 47, 33).tiles(10))
    assert mask.max() == 1
    assert mask.sum() == 44 * 28
