"""Rays behind the first layer, in surfaces that the video has shown, against the true world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from iprt.world.real.panorama import Panorama
from iprt.world.real.pyramid import PyramidShape
from tests.kernels.tracing import (
    SKY,
    SURFACE,
    Hits,
    RealTracer,
    panorama_of,
    random_directions,
)
from tests.oracles.worlds import Box, Sphere, World, frame_of
from tests.world.real.test_march import FURNISHED
from tests.worlds import landscape_frame

Float = NDArray[np.float64]
WIDTH, HEIGHT = 256, 128
BEFORE, NOW = Sphere((-0.3, -1.1, 1.6), 0.3), Sphere((0.6, -1.1, -0.4), 0.3)
"""The same ball in two frames; in each it stands on the floor."""
TRUE = World(solids=(*FURNISHED.solids, NOW))
EMPTY = FURNISHED
DIRECTIONS = View(WIDTH, HEIGHT, projection="equirect").directions()


@dataclass(frozen=True)
class Rays:
    """Random rays in the room, and what is true of them.

    `passes` tells which pass behind the ball as the capture centre sees it, before they end.
    """

    o: Float
    d: Float
    t: Float
    which: NDArray[np.int64]
    passes: NDArray[np.bool_]


def behind(solid: Sphere, points: Float) -> NDArray[np.bool_]:
    """Does the solid hide the points (..., 3) from the capture centre?"""
    r = np.linalg.norm(points, axis=-1)
    enter, *_ = solid.interval(np.zeros(3), points / r[..., None])
    return np.asarray((enter > 0.0) & (enter < r - 1e-3))


@pytest.fixture(scope="module")
def rays() -> Rays:
    rng = np.random.default_rng(1)
    o = rng.uniform(0.97 * np.array(TRUE.low), 0.97 * np.array(TRUE.high), (60_000, 3))
    o, d = o.astype(np.float32).astype(float), random_directions(rng, len(o)).astype(float)
    inside = np.zeros(len(o), bool)
    for solid in TRUE.solids:
        enter, leave, *_ = solid.interval(o, d)
        inside |= (enter < 0.0) & (leave > 0.0)
    o, d = o[~inside], d[~inside]
    t, _, which = TRUE.first_hit(o, d)
    along = np.linspace(0.0, 1.0, 49)[None, :, None]
    ways = t[:, None] * d
    passes = [
        behind(NOW, o[i : i + 8192, None] + along * ways[i : i + 8192, None]).any(1)
        for i in range(0, len(o), 8192)
    ]
    return Rays(o, d, t, which, np.concatenate(passes))


@pytest.fixture(scope="module")
def one(device: ComputeDevice) -> Panorama:
    return panorama_of(device, TRUE.frame(WIDTH, HEIGHT))


@pytest.fixture(scope="module")
def two(device: ComputeDevice) -> Panorama:
    before = World(solids=(*FURNISHED.solids, BEFORE)).frame(WIDTH, HEIGHT)
    return panorama_of(device, TRUE.frame(WIDTH, HEIGHT), before)


@pytest.fixture(scope="module")
def trace(device: ComputeDevice) -> RealTracer:
    return RealTracer(device, bassrt=True, background=True)


@pytest.fixture(scope="module")
def plain(device: ComputeDevice) -> RealTracer:
    return RealTracer(device, bassrt=True)


def shown_by(hits: Hits) -> NDArray[np.int64]:
    """Return the thing that the panorama or its memory shows at the hits' texels."""
    centre = np.zeros(3)
    seen, hidden = (w.first_hit(centre, DIRECTIONS)[2].ravel() for w in (TRUE, EMPTY))
    return np.where(hits.behind, hidden[hits.texel], seen[hits.texel])


def at_point(hits: Hits, rays: Rays) -> NDArray[np.bool_]:
    """Return the rays that end within two centimetres, or half a texel, of their true end."""
    ends = np.linalg.norm(rays.o + rays.t[:, None] * rays.d, axis=1)
    met = np.where(np.isfinite(hits.t), hits.t, 1e9)
    return np.asarray(np.abs(met - rays.t) < np.maximum(0.02, 0.5 * np.pi / HEIGHT * ends))


@pytest.mark.thorough
def test_more_rays_find_what_is_true(
    one: Panorama, two: Panorama, plain: RealTracer, trace: RealTracer, rays: Rays
) -> None:
    without, with_ = plain(one, rays.o, rays.d), trace(two, rays.o, rays.d)
    passes = rays.passes
    assert passes.sum() > 400

    def share(right: NDArray[np.bool_], of: NDArray[np.bool_]) -> float:
        return float(right[of].mean())

    right = [shown_by(hits) == rays.which for hits in (without, with_)]
    place = [at_point(hits, rays) for hits in (without, with_)]
    past = passes & (rays.which != len(TRUE.solids))  # rays that the ball's back does not stop
    assert past.sum() > 300
    assert share(place[0], past) < 0.3
    assert share(place[1], past) > 0.92
    assert share(right[1], past) > max(share(right[0], past) + 0.05, 0.93)
    assert share(right[1], passes) > share(right[0], passes) + 0.03
    # The others stay as they were.
    assert share(right[1], ~passes) >= share(right[0], ~passes) - 1e-4
    assert share(place[1], ~passes) >= share(place[0], ~passes) - 1e-4


def test_hidden_walls_are_met_to_rounding(two: Panorama, trace: RealTracer, rays: Rays) -> None:
    """The ball hides the plain floor or a wall, well within its outline."""
    point = rays.o + rays.t[:, None] * rays.d
    margin = np.sort(np.minimum(point - TRUE.low, TRUE.high - point), axis=1)[:, 1]
    inner = behind(Sphere(NOW.centre, 0.24), point) & (rays.which == 0) & (margin > 0.2)
    # In front of them all is free: nothing but the ball's own body is near.
    hits = trace(two, rays.o, rays.d)
    found = inner & hits.behind & (hits.kind == SURFACE)
    assert inner.sum() > 80
    assert found.sum() > 0.95 * inner.sum()
    assert np.abs(hits.t - rays.t)[found].max() < 1e-4
    column, row = np.floor(equirect_pixel(point, WIDTH, HEIGHT)).astype(int).T
    assert (hits.texel == row * WIDTH + column)[found].mean() > 0.97


@pytest.mark.parametrize("bassrt", [False, True])
def test_pyramid_skips_no_background(
    device: ComputeDevice, two: Panorama, rays: Rays, bassrt: bool
) -> None:
    """Hits equal those of a march through every texel."""
    trace = RealTracer(device, bassrt=bassrt, background=True, step_cap=1 << 20)
    quick = trace(two, rays.o, rays.d)
    shape = two.shape
    two.shape = PyramidShape(shape.columns[:1], shape.rows[:1])
    try:
        slow = trace(two, rays.o, rays.d)
    finally:
        two.shape = shape
    same = (quick.kind == slow.kind) & (quick.texel == slow.texel) & (quick.behind == slow.behind)
    assert quick.behind.sum() > 300
    assert (~same).sum() <= 2
    assert np.array_equal(quick.t[same], slow.t[same])


def test_without_anything_hidden_nothing_changes(
    device: ComputeDevice, one: Panorama, plain: RealTracer, trace: RealTracer, rays: Rays
) -> None:
    """A video in which nothing moves: every bit of every hit."""
    frame = TRUE.frame(WIDTH, HEIGHT)
    still = trace(panorama_of(device, frame, frame), rays.o, rays.d)
    single = plain(one, rays.o, rays.d)
    assert not still.behind.any()
    for name in ("t", "kind", "texel", "direction"):
        assert np.array_equal(getattr(still, name), getattr(single, name)), name


def test_background_is_joined_to_what_is_beside_it(
    device: ComputeDevice, trace: RealTracer
) -> None:
    """Rays into the wall behind a floating panel never leak through, whatever edge they cross."""
    panel = Box((0.0, 0.0, -1.2), (0.4, 0.4, 0.01))
    world = World(solids=(panel,))
    panorama = panorama_of(device, world.frame(WIDTH, HEIGHT), World().frame(WIDTH, HEIGHT))
    rng = np.random.default_rng(5)
    o = rng.uniform((-1.5, -1.0, -2.3), (1.5, 1.0, -1.5), (60_000, 3))
    aim = rng.uniform((-1.2, -1.2, -2.5), (1.2, 1.2, -2.5), (60_000, 3))
    d = (aim - o) / np.linalg.norm(aim - o, axis=1, keepdims=True)
    hits = trace(panorama, o, d)
    t, *_ = world.first_hit(o.astype(np.float32).astype(float), d)
    assert hits.behind.mean() > 0.1
    assert (hits.kind == SURFACE).all()
    assert np.abs(hits.t - t).max() < 0.15
    assert np.quantile(np.abs(hits.t - t), 0.99) < 1e-4


def test_open_sky_behind_a_thing(device: ComputeDevice, trace: RealTracer) -> None:
    empty = landscape_frame(WIDTH, HEIGHT)
    rows, columns = np.indices(empty.depth.shape)
    tower = (np.abs(columns - 128) < 12) & (rows > 30) & (rows < 70)
    view = np.where(tower[..., None], -DIRECTIONS, empty.normal)
    now = frame_of(np.where(tower, 3.0, empty.depth), view)
    panorama = panorama_of(
        device, now, Frame(empty.color, empty.depth, empty.opening, empty.normal)
    )
    rng = np.random.default_rng(8)
    n = 2000
    o = np.stack([rng.uniform(-0.3, 0.3, n), rng.uniform(0.2, 0.6, n), np.full(n, -5.0)], axis=1)
    d = random_directions(rng, n).astype(float)
    d[:, 2], d[:, 1] = -np.abs(d[:, 2]), np.abs(d[:, 1]) + 0.05
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    hits = trace(panorama, o, d)
    assert (hits.kind == SKY).all()
    column, row = np.floor(equirect_pixel(d, WIDTH, HEIGHT)).astype(int).T
    assert tower[row, column].sum() > 50
    assert np.array_equal(hits.behind, tower[row, column])
