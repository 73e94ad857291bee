"""The march through the panorama against brute force, analytic rooms and its extremes."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from tests.kernels.tracing import (
    SIDE,
    SURFACE,
    UNKNOWN,
    RealTracer,
    panorama_of,
    random_directions,
)
from tests.oracles.traverse import FlatLayer, trace_flat
from tests.oracles.worlds import Box, Sphere, World, difference_normals, frame_of

ROOM = World()
FURNISHED = World(
    solids=(
        Box((0.3, -1.0, -1.5), (0.4, 0.4, 0.3), 0.5),
        Box((-1.2, -0.9, 0.5), (0.3, 0.5, 0.3)),
        Sphere((1.0, 0.3, 1.2), 0.3),
    )
)
SIZES = [(1, 1), (2, 1), (3, 5), (7, 13), (64, 32), (255, 127), (256, 128)]


@pytest.fixture(scope="module")
def trace(device: ComputeDevice) -> RealTracer:
    return RealTracer(device)


@pytest.fixture(scope="module")
def trace_on(device: ComputeDevice) -> RealTracer:
    """Without a step cap that counts."""
    return RealTracer(device, step_cap=1 << 20)


def smooth(width: int, height: int) -> Frame:
    v = View(width, height, projection="equirect").directions()
    return frame_of(
        2.0 + 0.5 * np.sin(3 * v[..., 0] + 1) * np.cos(2 * v[..., 1]) + 0.3 * np.sin(5 * v[..., 2])
    )


def checkerboard(width: int, height: int) -> Frame:
    odd = np.indices((height, width)).sum(0) % 2
    normal = difference_normals(np.ones((height, width)))
    return frame_of(np.where(odd, 50.0, 0.5), normal)


def half_sky(width: int, height: int) -> Frame:
    rows = np.arange(height)[:, None] * np.ones(width)
    return frame_of(np.where(rows + 0.5 < height / 2, np.inf, 2.0))


def holes(width: int, height: int) -> Frame:
    frame = FURNISHED.frame(width, height)
    hole = np.random.default_rng(3).random((height, width)) < 0.05
    opening = hole & (np.arange(width) % 2 == 0)
    depth = np.where(hole & ~opening, np.inf, frame.depth)
    return frame_of(depth, frame.normal, opening)


PANORAMAS = {
    "room": ROOM.frame,
    "furnished": FURNISHED.frame,
    "smooth": smooth,
    "checkerboard": checkerboard,
    "half sky": half_sky,
    "holes": holes,
}


def rays_in(
    n: int, seed: int, low: object = -2.0, high: object = 2.0
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    o = rng.uniform(low, high, (n, 3)).astype(np.float32)
    return o, random_directions(rng, n)


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("name", PANORAMAS)
def test_agrees_with_brute_force(
    device: ComputeDevice, trace_on: RealTracer, name: str, size: tuple[int, int]
) -> None:
    panorama = panorama_of(device, PANORAMAS[name](*size))
    o, d = rays_in(4096, seed=7, low=-1.5, high=1.5)
    hits = trace_on(panorama, o, d)
    t, kind, texel = trace_flat(FlatLayer.read(device, panorama, 0.05, 0.05), o, d)
    finite = np.isfinite(t)
    assert finite.mean() > 0.02
    close = (
        np.abs(np.where(finite, hits.t, 0.0) - np.where(finite, t, 0.0))
        < 1e-3 * np.abs(np.where(finite, t, 1.0)) + 1e-5 * panorama.farthest
    )
    apart = np.abs(
        np.stack([hits.texel // panorama.width - texel // panorama.width,
                  (hits.texel - texel + panorama.width // 2) % panorama.width
                  - panorama.width // 2])
    ).max(0)  # fmt: skip
    same = (hits.kind == kind) & (close & (apart <= 1) | ~finite)
    # float32 decides two of 4096 rays otherwise, where one grazes an edge.
    assert (~same).sum() <= 2
    assert (hits.texel == texel)[finite].mean() >= 0.9985


def test_room_is_met_to_rounding_and_never_leaks(device: ComputeDevice, trace: RealTracer) -> None:
    panorama = panorama_of(device, ROOM.frame(256, 128))
    low, high = 0.98 * np.asarray(ROOM.low), 0.98 * np.asarray(ROOM.high)
    o, d = rays_in(200_000, 1, low, high)
    hits = trace(panorama, o, d)
    assert (hits.kind == SURFACE).all()
    t, _, _ = ROOM.first_hit(o.astype(float), d.astype(float))
    error = np.abs(hits.t - t)
    # A texel with an edge of the room in it is one plane: leave out what lies near an edge.
    point = o + t[:, None] * d.astype(float)
    r = np.linalg.norm(point, axis=1)
    margin = np.sort(np.minimum(point - ROOM.low, ROOM.high - point), axis=1)[:, 1]
    clear = margin > 2.0 * np.pi / 128 * r
    assert clear.mean() > 0.8
    assert np.quantile(error[clear], 0.999) < 1e-5 * r.max()
    # At edges the plane of one side stands out by less than a texel, seen at any angle.
    outside = np.maximum(o + hits.t[:, None] * d - ROOM.high, ROOM.low - o - hits.t[:, None] * d)
    assert outside.max() < 3.0 * np.pi / 128 * r.max()


def test_cap_is_not_reached_in_normal_panoramas(
    device: ComputeDevice, trace: RealTracer, trace_on: RealTracer
) -> None:
    for frame in (FURNISHED.frame(512, 256), smooth(512, 256)):
        panorama = panorama_of(device, frame)
        o, d = rays_in(100_000, 2, -1.9, 1.9)
        capped, free = trace(panorama, o, d), trace_on(panorama, o, d)
        assert np.array_equal(capped.kind, free.kind)
        assert np.array_equal(capped.t, free.t)


def test_capped_rays_are_unknown(device: ComputeDevice) -> None:
    panorama = panorama_of(device, ROOM.frame(256, 128))
    o, d = rays_in(4096, 2, -1.2, 1.2)
    hits = RealTracer(device, step_cap=6)(panorama, o, d)
    capped = hits.kind == UNKNOWN
    assert 0.5 < capped.mean() < 1.0
    assert np.isinf(hits.t[capped]).all()
    assert np.array_equal(hits.direction[capped], d[capped])


def test_sphere_around_the_centre(device: ComputeDevice, trace: RealTracer) -> None:
    v = View(256, 128, projection="equirect").directions()
    panorama = panorama_of(device, frame_of(np.full((128, 256), 2.0), -v))
    o, d = rays_in(20_000, 4, -1.0, 1.0)
    o64, d64 = o.astype(float), d.astype(float)
    along = (o64 * d64).sum(1)
    t = np.sqrt(along**2 - (o64**2).sum(1) + 4.0) - along
    error = np.abs(trace(panorama, o, d).t - t)
    # Texels are tangent planes, which leave the sphere by half the square of the angle; rays meet
    # them at 60 degrees or steeper.
    sagitta = 2.0 * (np.pi / 128) ** 2 / 4.0
    assert error.max() < 2.1 * sagitta
    # From the centre, through texel centres, it is exact.
    centre = trace(panorama, np.zeros(3), v.reshape(-1, 3))
    assert np.abs(centre.t - 2.0).max() < 2e-5
    assert np.array_equal(centre.texel, np.arange(256 * 128))


Rays = tuple[np.ndarray, np.ndarray]


def through_the_centre(aside_m: float) -> Rays:
    """Rays away from the centre, then towards it, that pass it by so many metres."""
    rng = np.random.default_rng(5)
    d = random_directions(rng, 5000).astype(float)
    aside = np.cross(d, random_directions(rng, 5000))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    d[::2] *= -1.0
    return rng.uniform(-1.2, 1.2, (5000, 1)) * d + aside_m * aside, d


def past_the_polar_axis() -> Rays:
    """Azimuth turns by half a circle within rounding; the ray goes on at the other side."""
    rng = np.random.default_rng(8)
    phi = rng.uniform(0, 2 * np.pi, 4000)
    phi[:64] = np.arange(64) * np.pi / 32
    heading = np.stack([np.cos(phi), 0 * phi, np.sin(phi)], 1)
    aside = np.stack([-np.sin(phi), 0 * phi, np.cos(phi)], 1)
    up = rng.uniform(-1.0, 1.0, (4000, 1)) * [0.0, 1.0, 0.0]
    miss = rng.choice([0.0, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4], (4000, 1))
    d = heading + 0.5 * up
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    top = np.sign(rng.normal(size=(4000, 1))) * [0.0, 0.8, 0.0]
    return top - rng.uniform(0.3, 0.9, (4000, 1)) * d + miss * aside, d


def along_axes(zero: float) -> Rays:
    """Directions with components of 0 or -0, from the centre, axes, texel edges and elsewhere."""
    diagonal = np.array([[s, c, 0] for s in (-0.6, 0.6) for c in (-0.8, 0.8)])
    d = np.concatenate([np.eye(3), -np.eye(3), *(np.roll(diagonal, i, 1) for i in range(3))])
    o = [np.zeros(3), np.array([0.0, 0.7, 0.0]), np.array([0.0, -0.9, 0.0])]
    o += [s * e for s in (-0.5, 1.0) for e in np.eye(3)]
    o += list(np.random.default_rng(6).uniform(-1.2, 1.2, (50, 3)))
    d = np.where(d == 0.0, zero, d)
    return np.repeat(o, len(d), axis=0), np.tile(d, (len(o), 1))


def grazing_the_floor() -> Rays:
    """Rays that leave the floor at 89.99 degrees neither hit it again nor fall through it."""
    rng = np.random.default_rng(11)
    n = 5000
    phi, slope = rng.uniform(0, 2 * np.pi, n), np.deg2rad(0.01)
    o = np.stack([rng.uniform(-1.8, 1.8, n), np.full(n, -1.4), rng.uniform(-2.2, 2.2, n)], 1)
    o[:, 1] += 2.0 * np.pi / 128 * np.linalg.norm(o, axis=1)
    across = np.cos(slope) * np.array([np.cos(phi), np.sin(phi)])
    return o, np.stack([across[0], np.full(n, np.sin(slope)), across[1]], 1)


@pytest.mark.parametrize(
    ("rays", "share", "near", "most"),
    [
        # A whole texel may be off next to the room's edges, and where the offset is neglected.
        (through_the_centre(0.0), 0.98, 1e-5, 0.2),
        *((through_the_centre(aside), 0.98, 2e-3, 0.2) for aside in (1e-7, 1e-5, 1e-3)),
        (past_the_polar_axis(), 0.95, 1e-4, 0.2),
        (along_axes(0.0), 1.0, 0.08, 0.08),
        (along_axes(-0.0), 1.0, 0.08, 0.08),
        (grazing_the_floor(), 0.998, 0.15, 2.0),
    ],
    ids=["centre", "1e-7 m", "1e-5 m", "1e-3 m", "pole", "axes", "minus zero", "grazing"],
)
def test_rays_in_a_room_meet_its_walls(
    device: ComputeDevice, trace: RealTracer, rays: Rays, share: float, near: float, most: float
) -> None:
    o, d = rays
    hits = trace(panorama_of(device, ROOM.frame(256, 128)), o, d)
    assert (hits.kind == SURFACE).all()
    error = np.abs(hits.t - ROOM.first_hit(o, d)[0])
    assert np.quantile(error, share) <= near
    assert error.max() < most
    end = o + hits.t[:, None] * d
    assert (np.minimum(end - ROOM.low, ROOM.high - end).min(1) > -0.1).all()


@pytest.mark.parametrize("columns", [1, 64, 100])
def test_panorama_rolled_rolls_the_hits(
    device: ComputeDevice, trace: RealTracer, columns: int
) -> None:
    frame = FURNISHED.frame(256, 128)
    angle = columns * 2.0 * np.pi / 256
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    rolled = frame_of(np.roll(frame.depth, columns, 1), np.roll(frame.normal, columns, 1) @ turn.T)
    o, d = rays_in(20_000, 9, -1.2, 1.2)
    # Some start on the seam, and some on texel edges.
    o[:200] = [[0.0, y, 1.0] for y in np.linspace(-1.0, 1.0, 200)]
    o[200:400] = [[0.0, y, -1.0] for y in np.linspace(-1.0, 1.0, 200)]
    plain = trace(panorama_of(device, frame), o, d)
    turned = trace(panorama_of(device, rolled), o @ turn.T, d @ turn.T)
    row, column = plain.texel // 256, (plain.texel + columns) % 256
    same = turned.texel == row * 256 + column
    assert same[400:].mean() >= 0.999
    assert same[:400].mean() >= 0.98
    both = np.isfinite(plain.t) & np.isfinite(turned.t)
    error = np.abs(np.where(both, turned.t, 0.0) - np.where(both, plain.t, 0.0))
    assert np.quantile(error, 0.998) < 1e-4
    assert (plain.kind == turned.kind).mean() >= 0.9995


@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_scale_changes_no_texel(device: ComputeDevice, trace: RealTracer, scale: float) -> None:
    frame = FURNISHED.frame(256, 128)
    scaled = frame_of(frame.depth * np.float32(scale), frame.normal)
    o, d = rays_in(50_000, 10, -1.2, 1.2)
    plain = trace(panorama_of(device, frame), o, d)
    other = trace(panorama_of(device, scaled), o.astype(float) * scale, d)
    assert (plain.texel == other.texel).mean() >= 0.9999
    assert (plain.kind == other.kind).mean() >= 0.9999
    both = np.isfinite(plain.t) & np.isfinite(other.t)
    ratio = np.where(both, other.t, 1.0) / scale - np.where(both, plain.t, 1.0 / scale)
    assert np.quantile(np.abs(ratio[both]), 0.999) < 1e-5


def test_what_is_no_ray_ends_defined(device: ComputeDevice, trace: RealTracer) -> None:
    panorama = panorama_of(device, ROOM.frame(64, 32))
    bad = [np.nan, np.inf, -np.inf]
    good, up = [0.1, 0.2, 0.3], [0.0, 0.6, -0.8]
    cases = [(good, [0.0, 0.0, 0.0]), (good, [1e-30, 0.0, 0.0])]
    for value in bad:
        for axis in range(3):
            broken = list(up)
            broken[axis] = value
            cases += [(good, broken), (broken, up)]
    o, d = (np.array(part) for part in zip(*cases, strict=True))
    hits = trace(panorama, o, d)
    assert (hits.kind == UNKNOWN).all()
    assert (hits.texel == 0).all()
    assert np.isfinite(hits.direction).all()
    assert not np.isnan(hits.t).any()


def test_slab_is_as_thick_as_assumed(device: ComputeDevice, trace: RealTracer) -> None:
    """Behind a free-standing slab, rays go on; within the thickness they meet its side."""
    slab = Box((0.0, 0.0, -1.0), (0.3, 0.5, 0.005))
    world = World(solids=(slab,))
    panorama = panorama_of(device, world.frame(512, 256))
    n = 200
    y = np.linspace(-0.2, 0.2, n)
    d = np.broadcast_to([-1.0, 0.0, 0.0], (n, 3))
    for behind, side in ((0.03, True), (0.06, True), (0.14, False), (0.3, False)):
        z = -0.995 - behind
        o = np.stack([np.full(n, 1.2), y, np.full(n, z)], 1)
        hits = trace(panorama, o, d, 0.1, 0.0)
        if side:
            assert (hits.kind == SIDE).all(), behind
            edge = o[:, 0] - hits.t
            assert np.abs(edge - 0.3 * z / -0.995).max() < 0.03
        else:
            assert (hits.kind == SURFACE).all(), behind
            assert np.abs(hits.t - 3.2).max() < 0.03


@pytest.mark.parametrize("yaw_deg", [0.0, 11.25, 22.5, 191.25, 202.5])
def test_ray_behind_a_surface_dips_into_its_thickness(
    device: ComputeDevice, trace: RealTracer, yaw_deg: float
) -> None:
    """The ray's closest point may lie anywhere in the coarse cells that skip it."""
    yaw = np.deg2rad(yaw_deg)
    ahead = np.array([np.sin(yaw), 0.0, -np.cos(yaw)])
    right = np.array([np.cos(yaw), 0.0, np.sin(yaw)])
    v = View(256, 128, projection="equirect").directions()
    shell = (v @ ahead > 0.0) & (np.abs(v @ right) < np.sin(np.deg2rad(60.0)))
    frame = frame_of(np.where(shell & (np.abs(v[..., 1]) < 0.5), 1.0, 5.0), -v)
    n = 50
    closest = 1.005 * ahead + np.linspace(-0.05, 0.05, n)[:, None] * [0.0, 1.0, 0.0]
    panorama = panorama_of(device, frame)
    thickness = 0.01 / panorama.scale
    hits = trace(panorama, closest - 3.0 * right, np.tile(right, (n, 1)), thickness, 0.0)
    assert (hits.kind == SIDE).all()
    meets = 3.0 - np.sqrt(np.maximum(1.01**2 - (closest**2).sum(1), 0.0))
    assert np.abs(hits.t - meets).max() < 0.05


def test_a_start_just_below_a_surface_is_on_it(device: ComputeDevice, trace: RealTracer) -> None:
    """Positions are rounded: within the bias, a ray into the wall meets it where it starts."""
    panorama = panorama_of(device, ROOM.frame(256, 128))
    bias = 1e-3 * panorama.scale
    n = 100
    rng = np.random.default_rng(8)
    wall = np.stack([np.full(n, ROOM.high[0]), *rng.uniform(-0.8, 0.8, (2, n))], axis=1)
    into = np.array([1.0, 0.0, 0.0])
    d = np.array([1.0, 0.3, 0.2]) + rng.uniform(-0.2, 0.2, (n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    on = trace(panorama, wall + 0.4 * bias * into, d)
    assert (on.kind == SURFACE).all()
    assert on.t.max() < 1e-3
    below = trace(panorama, wall + 4.0 * bias * into, d)
    assert not ((below.kind == SURFACE) & (below.t < 1e-3)).any()
