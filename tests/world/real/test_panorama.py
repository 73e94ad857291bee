"""The panorama's structures per video frame: tangent planes, connectivity, ranges, pyramid."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_direction
from iprt.world.real.panorama import Panorama
from iprt.world.real.pyramid import PyramidShape, equirect_edges
from tests.kernels.tracing import panorama_of
from tests.oracles.worlds import Box, World, frame_of

EAST, WEST, NORTH, SOUTH, OPENING, NONE = (1 << i for i in range(6))
ROOM = World((-20.0, -1.4, -20.0), (20.0, 1.3, 20.0))


def read(device: ComputeDevice, panorama: Panorama) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(H, W, 3) planes, (H, W) flags, (H, W, 2) leaf ranges."""
    surface = device.read(panorama.surface)
    texels = panorama.width * panorama.height
    range_ = device.read(panorama.range)[:texels].reshape(panorama.height, panorama.width, 2)
    return surface[..., :3], surface[..., 3].astype(int), range_


def test_planes_are_connected_at_every_inclination(device: ComputeDevice) -> None:
    """A long low room: the floor is connected up to where it meets walls ten times as far."""
    frame = ROOM.frame(256, 128)
    _, flags, _ = read(device, panorama_of(device, frame))
    v = View(256, 128, projection="equirect").directions()
    _, normal, _ = ROOM.first_hit(np.zeros(3), v)
    same_down = (normal[:-1] == normal[1:]).all(-1)
    assert (frame.depth.max() / frame.depth.min()) > 15.0
    assert ((flags[:-1] & SOUTH) != 0)[same_down].all()
    assert ((flags[1:] & NORTH) != 0)[same_down].all()
    same_east = (normal == np.roll(normal, -1, 1)).all(-1)
    assert ((flags & EAST) != 0)[same_east].all()
    assert ((np.roll(flags, -1, 1) & WEST) != 0)[same_east].all()
    # A room of usual size has no gaps at all: its walls meet.
    _, flags, _ = read(device, panorama_of(device, World().frame(256, 128)))
    assert ((flags[:-1] & SOUTH) != 0).all()
    assert ((flags & EAST) != 0).all()
    assert (flags[0] & NORTH == 0).all()
    assert (flags[-1] & SOUTH == 0).all()


def test_depth_step_is_a_gap_on_both_sides(device: ComputeDevice) -> None:
    """Also across the seam, which is behind: there a box has its edge."""
    boxes = (Box((0.0, 0.0, -1.2), (0.3, 0.3, 0.1)), Box((0.3, 0.0, 1.2), (0.3, 0.3, 0.1)))
    world = World(solids=boxes)
    frame = world.frame(256, 128)
    _, flags, _ = read(device, panorama_of(device, frame))
    v = View(256, 128, projection="equirect").directions()
    _, _, which = world.first_hit(np.zeros(3), v)
    across = which != np.roll(which, -1, 1)
    down = which[:-1] != which[1:]
    assert across.sum() > 20
    assert across[:, -1].sum() > 20
    assert down.sum() > 20
    assert ((flags & EAST) == 0)[across].all()
    assert ((np.roll(flags, -1, 1) & WEST) == 0)[across].all()
    assert ((flags[:-1] & SOUTH) == 0)[down].all()
    assert ((flags[1:] & NORTH) == 0)[down].all()
    inside = (which == 1) & (np.roll(which, -1, 1) == 1)
    assert ((flags & EAST) != 0)[inside].all()


@pytest.mark.parametrize("size", [(64, 32), (37, 23), (256, 128)], ids=str)
def test_leaf_ranges_hold_the_plane(device: ComputeDevice, size: tuple[int, int]) -> None:
    """At random directions in each texel, wherever planes are connected to all neighbours."""
    width, height = size
    world = World(solids=(Box((0.0, 0.0, -1.2), (0.3, 0.3, 0.1)),))
    g, flags, range_ = read(device, panorama_of(device, world.frame(width, height)))
    rng = np.random.default_rng(2)
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    inner = (flags & 15) == 15
    v = View(width, height, projection="equirect").directions()
    _, normal, _ = world.first_hit(np.zeros(3), v)
    for step, axis in ((1, 0), (-1, 0), (1, 1), (-1, 1)):
        inner &= (np.roll(normal, step, axis) == normal).all(-1)
    inner[[0, -1]] = False
    assert inner.mean() > 0.5
    for _ in range(20):
        pixel = np.stack([x + rng.random(x.shape), y + rng.random(x.shape)], -1)
        radius = 1.0 / (g * equirect_direction(pixel, width, height)).sum(-1)
        assert (radius >= range_[..., 0] * (1.0 - 1e-5))[inner].all()
        assert (radius <= range_[..., 1] * (1.0 + 1e-5))[inner].all()


def test_ranges_stay_near_the_depth(device: ComputeDevice) -> None:
    """A plane seen edge-on would run away within its texel: ranges do not follow it.

    It is tilted, and still passes through the depth at the texel's centre.
    """
    depth = np.full((32, 64), 2.0)
    v = View(64, 32, projection="equirect").directions()
    aside = np.cross(v, [0.0, 1.0, 0.0])
    g, _, range_ = read(device, panorama_of(device, frame_of(depth, aside)))
    np.testing.assert_allclose((g * v).sum(-1) * 2.0, 1.0, rtol=1e-5)
    footprint = np.pi / 32 * 2.0
    assert (range_[..., 0] >= 2.0 - footprint * 1.001).all()
    assert (range_[..., 1] <= 2.0 + footprint * 1.001).all()
    assert (range_[..., 0] <= 2.0).all()
    assert (range_[..., 1] >= 2.0).all()


def test_openings_and_sky_are_flagged(device: ComputeDevice) -> None:
    depth = np.full((8, 16), 2.0)
    depth[2, 3] = np.inf
    opening = np.zeros((8, 16), bool)
    opening[5, 6] = True
    _, flags, range_ = read(device, panorama_of(device, frame_of(depth, None, opening)))
    assert np.array_equal((flags & OPENING) != 0, opening)
    assert np.array_equal((flags & NONE) != 0, np.isinf(depth))
    assert flags[2, 3] == NONE
    assert flags[2, 2] & EAST == 0
    assert flags[1, 3] & SOUTH == 0
    assert np.isposinf(range_[2, 3]).all()


@pytest.mark.parametrize(
    "size", [(1, 1), (2, 1), (3, 5), (7, 13), (255, 127), (256, 128), (130, 67)], ids=str
)
def test_every_cell_bounds_its_texels(device: ComputeDevice, size: tuple[int, int]) -> None:
    rng = np.random.default_rng(4)
    depth = rng.uniform(0.5, 50.0, (size[1], size[0]))
    depth[rng.random(depth.shape) < 0.01] = np.inf
    panorama = panorama_of(device, frame_of(depth, -np.ones((size[1], size[0], 3)) / 3**0.5))
    range_ = device.read(panorama.range)
    _, _, leaf = read(device, panorama)
    shape = panorama.shape
    assert 8 <= shape.columns[-1] <= 16
    for level in range(shape.levels):
        cells = range_[shape.offsets[level] : shape.offsets[level + 1]]
        cells = cells.reshape(shape.rows[level], shape.columns[level], 2)
        size_ = 1 << level
        tall = np.arange(0, panorama.height, size_)
        wide = np.arange(0, panorama.width, size_)
        low = np.minimum.reduceat(np.minimum.reduceat(leaf[..., 0], tall, 0), wide, 1)
        high = np.maximum.reduceat(np.maximum.reduceat(leaf[..., 1], tall, 0), wide, 1)
        assert np.array_equal(cells[..., 0], low)
        assert np.array_equal(cells[..., 1], high)


def test_shape_and_edges() -> None:
    shape = PyramidShape.of(255, 127, 8)
    assert shape.columns == (255, 128, 64, 32, 16, 8)
    assert shape.rows == (127, 64, 32, 16, 8, 4)
    assert shape.offsets[1] == 255 * 127
    column, row = equirect_edges(255, 127)
    assert np.array_equal(column[0], column[-1])
    assert row[0] == 1.0
    assert row[-1] == -1.0
    # A column edge is the normal of its meridian, a row edge the cosine of its polar angle.
    x, y = np.arange(256.0), np.arange(128.0)
    along = equirect_direction(np.stack([x, 0 * x + 40.0], -1), 255, 127)
    assert np.abs(column[:, 0] * along[:, 0] + column[:, 1] * along[:, 2]).max() < 1e-6
    down = equirect_direction(np.stack([0 * y + 9.0, y], -1), 255, 127)
    assert np.abs(row - down[:, 1]).max() < 1e-6


def test_scale_and_depths(device: ComputeDevice) -> None:
    depth = np.array([[1.0, 4.0, np.inf, 3.0]] * 2)
    panorama = panorama_of(device, frame_of(depth))
    assert (panorama.nearest, panorama.farthest) == (1.0, 4.0)
    assert panorama.median_depth == 3.0
    assert panorama.scale == 1.5
