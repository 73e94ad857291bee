"""Holes in depth: what they are taken for, and what fills them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.prepare.fill import sanitize_color, sanitize_depth
from iprt.footage.prepare.openings import classify_holes
from iprt.geometry.equirect import solid_angles
from tests.scene.files import box_room, directions

W, H = 128, 64
DEPTH, _ = box_room(W, H)
POINTS = directions(W, H) * DEPTH[..., None]
GREY = np.ones((H, W, 3), np.float32)

WINDOW = (POINTS[..., 2] < -2.999) & (np.abs(POINTS[..., :2]) < (1.0, 0.8)).all(-1)
SEAM_WINDOW = (POINTS[..., 2] > 1.999) & (np.abs(POINTS[..., :2]) < (0.9, 0.7)).all(-1)
TRIPOD = (POINTS[..., 1] < -1.299) & (np.hypot(POINTS[..., 0], POINTS[..., 2]) < 0.5)
SKYLIGHT = (POINTS[..., 1] > 1.399) & (np.hypot(POINTS[..., 0], POINTS[..., 2]) < 0.8)


def holed(mask: NDArray[np.bool_], value: float = 0.0) -> NDArray[np.float32]:
    return np.where(mask, value, DEPTH).astype(np.float32)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, -np.inf])
def test_every_kind_of_hole_is_found(value: float) -> None:
    clean = sanitize_depth(holed(WINDOW, value), GREY)
    assert np.array_equal(clean.opening, WINDOW)


def test_depth_without_holes_is_unchanged() -> None:
    clean = sanitize_depth(DEPTH.astype(np.float32), GREY)
    assert np.array_equal(clean.depth, DEPTH.astype(np.float32))
    assert not clean.opening.any()


@pytest.mark.parametrize("hole", [WINDOW, SEAM_WINDOW, TRIPOD, SKYLIGHT])
def test_a_hole_in_a_wall_is_filled_with_the_wall(hole: NDArray[np.bool_]) -> None:
    assert hole.any()
    clean = sanitize_depth(holed(hole), GREY)
    assert np.abs(clean.depth[hole] / DEPTH[hole] - 1).max() < 2e-3
    assert np.array_equal(clean.depth[~hole], DEPTH[~hole].astype(np.float32))


def test_filling_follows_the_picture_when_it_is_shifted() -> None:
    for shift in (1, 31, 64):
        mask = np.roll(WINDOW, shift, axis=1)
        depth = np.where(mask, 0.0, np.roll(DEPTH, shift, axis=1)).astype(np.float32)
        here = sanitize_depth(holed(WINDOW), GREY)
        there = sanitize_depth(depth, GREY)
        assert np.allclose(np.roll(here.depth, shift, axis=1), there.depth, rtol=2e-3)
        assert np.array_equal(np.roll(here.opening, shift, axis=1), there.opening)


def test_a_hole_between_two_depths_stays_between_them() -> None:
    depth = np.full((H, W), 2.0, np.float32)
    depth[:, 64:] = 5.0
    depth[28:36, 56:72] = 0.0
    filled = sanitize_depth(depth, GREY).depth[28:36, 56:72]
    assert 1.9 < filled.min() < filled.max() < 5.1


def test_the_tripod_is_floor_and_a_skylight_is_an_opening() -> None:
    assert not sanitize_depth(holed(TRIPOD), GREY).opening.any()
    assert np.array_equal(sanitize_depth(holed(SKYLIGHT), GREY).opening, SKYLIGHT)


def test_open_sky_stays_at_infinity() -> None:
    sky = POINTS[..., 1] > 0.3 * np.hypot(POINTS[..., 0], POINTS[..., 2])
    clean = sanitize_depth(holed(sky), GREY)
    assert np.isinf(clean.depth[sky]).all()
    assert not clean.opening.any()
    assert np.array_equal(clean.depth[~sky], DEPTH[~sky].astype(np.float32))


def test_a_street_has_open_sky_though_it_is_narrow() -> None:
    x, y = np.moveaxis(directions(W, H), -1, 0)[:2]
    sky = (np.abs(x) < 0.25 * y) & (y > 0.2)
    assert (solid_angles(W, H)[:, None] * sky).sum() < 2.0
    assert np.isinf(sanitize_depth(holed(sky), GREY).depth[sky]).all()


def test_all_holes_is_open_sky() -> None:
    for width, height in ((2, 1), (4, 2), (64, 32)):
        clean = sanitize_depth(
            np.zeros((height, width), np.float32), np.ones((height, width, 3), np.float32)
        )
        assert np.isinf(clean.depth).all()
        assert not clean.opening.any()


@pytest.mark.parametrize("white", [1e-4, 1.0])
def test_sensor_dropouts_are_surface_unless_they_are_bright(white: float) -> None:
    width, height = 1024, 512
    depth, _ = box_room(width, height)
    mask = np.zeros((height, width), bool)
    mask[250:252, 700] = True
    holed_depth = np.where(mask, np.nan, depth).astype(np.float32)
    color = np.full((height, width, 3), white, np.float32)
    clean = sanitize_depth(holed_depth, color)
    assert not clean.opening.any()
    assert np.abs(clean.depth[mask] / depth[mask] - 1).max() < 1e-4
    color[mask] = 30.0 * white
    assert np.array_equal(sanitize_depth(holed_depth, color).opening, mask)


def test_a_dropout_is_compared_with_its_four_neighbours() -> None:
    """One bright neighbour of four makes the rim bright; a diagonal one is none of the rim."""
    for down, right, near in (
        (-1, 0, True),
        (1, 0, True),
        (0, -1, True),
        (0, 1, True),
        (1, 1, False),
    ):
        hole = np.zeros((512, 1024), bool)
        hole[250, 0] = True  # the left neighbour lies across the seam
        color = np.full((512, 1024, 3), 0.5, np.float32)
        color[250, 0] = 2.0
        color[250 + down, right] = 100.0
        found = classify_holes(hole, color)
        assert found.dropout[250, 0] == near
        assert found.opening[250, 0] != near


def test_open_sky_holds_the_zenith_itself() -> None:
    hole = np.zeros((16, 32), bool)
    hole[1:7, 4:8] = True  # down to 11 degrees above the horizon
    color = np.ones((16, 32, 3), np.float32)
    assert np.array_equal(classify_holes(hole, color).opening, hole)
    hole[0, 4] = True
    assert np.array_equal(classify_holes(hole, color).open_sky, hole)


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, -3.0])
def test_scattered_bad_depth_leaves_a_usable_frame(value: float) -> None:
    mask = np.random.default_rng(3).random((H, W)) < 0.05
    clean = sanitize_depth(holed(mask, value), GREY)
    assert np.isfinite(clean.depth).all()
    assert (clean.depth > 0).all()
    assert np.median(np.abs(clean.depth[mask] / DEPTH[mask] - 1)) < 2e-3


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_scale_does_not_matter(scale: float) -> None:
    here = sanitize_depth(holed(WINDOW), GREY)
    there = sanitize_depth((scale * holed(WINDOW)).astype(np.float32), GREY)
    assert np.allclose(there.depth, scale * here.depth, rtol=1e-5)


def test_holes_touch_across_seam_pole_and_corner() -> None:
    hole = np.zeros((8, 16), bool)
    hole[3, 15] = hole[4, 0] = True  # diagonal across the seam
    hole[0, 2] = hole[0, 9] = True  # both at the zenith
    color = np.ones((8, 16, 3), np.float32)
    color[3, 15] = 50.0
    found = classify_holes(hole, color)
    # One bright texel makes its whole component an opening.
    assert found.opening[3, 15]
    assert found.opening[4, 0]
    assert found.opening[0, 2] == found.opening[0, 9]


def test_color_is_made_usable() -> None:
    color = np.array([[[np.nan, np.inf, -1.0], [0.0, 1e-30, 65504.0]]], np.float32)
    assert np.array_equal(sanitize_color(color), [[[0, 0, 0], [0, np.float32(1e-30), 65504]]])
