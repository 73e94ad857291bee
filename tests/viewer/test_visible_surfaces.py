"""Where objects that are dropped into a picture come to stand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.geometry.pose import view_from
from iprt.viewer.visible_surfaces import Geometry
from tests.oracles.worlds import Box, World

FLOOR, TABLE_TOP, WALL = -1.4, -0.8, -4.0
ROOM = World(low=(-4.0, FLOOR, WALL), high=(4.0, 1.3, 4.0))
TABLE = World(
    low=(-4.0, FLOOR, WALL),
    high=(4.0, 1.3, 4.0),
    solids=(Box((0.0, -0.85, -1.5), (0.6, 0.05, 0.4)),),
)
LOOK = View(240, 180, 0.0, -25.0, 60.0)
NOISE = 0.01
RADIUS = 0.15


def geometry(world: World, noise: float, pose: NDArray[np.float64] | None = None) -> Geometry:
    """What a camera inside a room sees; depth has white noise of this share."""
    directions = view_from(LOOK, pose).directions()
    depth, normal, _ = world.first_hit(np.zeros(3), directions)
    depth = depth * (1.0 + noise * np.random.default_rng(0).normal(size=depth.shape))
    nothing = np.zeros(depth.shape, np.float32)
    return Geometry(
        LOOK,
        pose,
        (),
        depth.astype(np.float32),
        normal.astype(np.float32),
        nothing,
        np.zeros((*depth.shape, 3), np.float32),
        nothing,
        nothing.astype(np.int32),
        (),
    )


def places(rows: range) -> list[tuple[int, int]]:
    return [(x, y) for x in range(30, 225, 30) for y in rows]


@pytest.mark.parametrize("noise", [0.0, NOISE])
def test_the_foot_is_on_the_floor_within_a_fraction_of_the_noise(noise: float) -> None:
    seen = geometry(ROOM, noise)
    for x, y in places(range(105, 180, 15)):
        surface = seen.ground(x, y, RADIUS)
        assert surface is not None
        assert surface.point[1] == pytest.approx(FLOOR, abs=max(0.25 * noise * -FLOOR, 1e-6))
        np.testing.assert_allclose(surface.normal, (0.0, 1.0, 0.0), atol=1e-6)


def test_single_noisy_normals_do_not_tilt_objects() -> None:
    seen = geometry(ROOM, 0.0)
    tilt = np.random.default_rng(0).normal(0.0, 0.2, seen.real_normal.shape).astype(np.float32)
    noisy = seen.real_normal + tilt
    seen.real_normal[:] = noisy / np.linalg.norm(noisy, axis=-1, keepdims=True)
    for x, y in places(range(120, 180, 15)):
        surface = seen.ground(x, y, RADIUS)
        assert surface is not None
        assert surface.normal[1] > np.cos(np.radians(4.0))
        assert surface.point[1] == pytest.approx(FLOOR, abs=0.01)


def test_the_edge_of_a_table_carries() -> None:
    """The footprint hangs over the edge by half; the floor below is no part of the table."""
    seen = geometry(TABLE, NOISE)
    for edge in (0.58, -0.58):
        x, y = (int(value) for value in LOOK.project(np.array([edge, TABLE_TOP, -1.5])))
        surface = seen.ground(x, y, RADIUS)
        assert surface is not None
        assert surface.point[1] == pytest.approx(TABLE_TOP, abs=0.4 * NOISE * -TABLE_TOP)


def test_a_camera_that_moved_puts_things_in_the_same_axes() -> None:
    """Turned by 30 degrees, and elsewhere in the world."""
    angle = np.radians(30.0)
    pose = np.eye(4)
    pose[:3, :3] = [
        [np.cos(angle), 0.0, np.sin(angle)],
        [0.0, 1.0, 0.0],
        [-np.sin(angle), 0.0, np.cos(angle)],
    ]
    pose[:3, 3] = (3.0, 2.0, 1.0)
    seen = geometry(ROOM, NOISE, pose)
    for x, y in places(range(120, 180, 15)):
        surface, one_pixel = seen.ground(x, y, RADIUS), seen.real(x, y)
        assert surface is not None
        assert one_pixel is not None
        assert surface.point[1] == pytest.approx(2.0 + FLOOR, abs=0.25 * NOISE * -FLOOR)
        assert np.linalg.norm(surface.point - one_pixel.point) < 5.0 * NOISE * one_pixel.depth_m


def test_open_sky_carries_nothing() -> None:
    seen = geometry(ROOM, 0.0)
    seen.real_depth[:90] = np.inf
    assert seen.ground(120, 45, RADIUS) is None
    surface = seen.ground(120, 90, 10.0)
    assert surface is not None
    assert surface.point[1] == pytest.approx(FLOOR, abs=1e-6)
