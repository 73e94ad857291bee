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
    return seen_as(depth, normal, pose)


def seen_as(
    depth: NDArray[np.float64], normal: NDArray[np.float64], pose: NDArray[np.float64] | None
) -> Geometry:
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


def rounded_table(rounding: float) -> Geometry:
    """A table whose edges are rounded, above the floor, by sphere tracing."""
    middle, half = np.array([0.0, -0.85, -1.5]), np.array([0.6, 0.05, 0.4])
    directions = LOOK.directions()

    def distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
        outside = np.abs(points - middle) - (half - rounding)
        corner = np.linalg.norm(np.maximum(outside, 0.0), axis=-1)
        table = corner + np.minimum(outside.max(axis=-1), 0.0) - rounding
        return np.minimum(table, points[..., 1] - FLOOR)

    depth = np.zeros(directions.shape[:2])
    for _ in range(400):
        depth += np.minimum(distance(depth[..., None] * directions), 10.0)
    points, step = depth[..., None] * directions, 1e-5 * np.eye(3)
    normal = np.stack([distance(points + e) - distance(points - e) for e in step], axis=-1)
    depth[depth > 100.0] = np.inf
    return seen_as(depth, normal / np.linalg.norm(normal, axis=-1, keepdims=True), None)


@pytest.mark.parametrize("rounding", [0.02, 0.04])
def test_upright_objects_do_not_sink_into_rounded_edges(rounding: float) -> None:
    """The pixels of the edge lie up to the rounding below the top; aligned objects follow it."""
    seen = rounded_table(rounding)
    column = LOOK.width // 2
    rows = [
        y
        for y in range(LOOK.height)
        if (real := seen.real(column, y)) is not None
        and TABLE_TOP - rounding < real.point[1] < TABLE_TOP - 1e-3
        and real.normal[1] > 0.1
    ]
    assert len(rows) > 1
    for y in rows:
        upright = seen.ground(column, y, RADIUS, upright=True)
        tilted = seen.ground(column, y, RADIUS)
        assert upright is not None
        assert tilted is not None
        assert upright.point[1] == pytest.approx(TABLE_TOP, abs=1e-3)
        assert tilted.normal[1] < 0.97
    floor = seen.ground(column, LOOK.height - 1, RADIUS, upright=True)
    assert floor is not None
    assert floor.point[1] == pytest.approx(FLOOR, abs=1e-6)


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
