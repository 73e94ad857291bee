"""Rays against rasterized solids, compared with the solids themselves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from tests.kernels.tracing import ObjectTracer, layers_of, random_directions
from tests.oracles.worlds import Box, Solid, Sphere

Float = NDArray[np.float64]

AROUND = View(512, 256, projection="equirect")
SCREEN = View(256, 256, yaw_deg=20.0, pitch_deg=-15.0, fov_y_deg=50.0)
SOLIDS: dict[str, tuple[Solid, ...]] = {
    "ball": (Sphere((0.4, -0.7, -2.0), 0.4),),
    "box": (Box((0.4, -0.7, -2.0), (0.3, 0.3, 0.3), 0.4),),
    "lying plate": (Box((0.4, -0.7, -2.0), (0.4, 0.01, 0.4), 0.4),),
    "standing plate": (Box((0.4, -0.7, -2.0), (0.4, 0.4, 0.01), 0.6),),
    "ball half off screen": (Sphere((-0.17, -0.7, -2.0), 0.4),),
    "ball off screen": (Sphere((-1.5, 0.3, 1.0), 0.4),),
}
N = 8000

Tracers = dict[tuple[str, str], ObjectTracer]


@pytest.fixture(scope="module")
def tracers(device: ComputeDevice) -> Tracers:
    return {
        (name, view.projection): ObjectTracer(device, view, solids, AROUND)
        for name, solids in SOLIDS.items()
        for view in (SCREEN, AROUND)
    }


def unit(v: Float) -> Float:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def truth(solids: tuple[Solid, ...], o: Float, d: Float, grown: float = 0.0) -> Float:
    """Distance to the first surface, of solids grown by so many metres."""
    t = np.full(len(d), np.inf)
    for solid in solids:
        if isinstance(solid, Sphere):
            solid = Sphere(solid.centre, solid.radius + grown)
        else:
            x, y, z = solid.half
            half = (max(x + grown, 1e-4), max(y + grown, 1e-4), max(z + grown, 1e-4))
            solid = Box(solid.centre, half, solid.yaw)
        enter, leave, _, _ = solid.interval(o, d)
        first = np.where(enter > 0.0, enter, np.where(leave > 0.0, leave, np.inf))
        t = np.minimum(t, first)
    return t


def footprint(tracer: ObjectTracer, solids: tuple[Solid, ...]) -> float:
    """Metres that a texel of the coarser layer covers at the solids."""
    far = max(np.linalg.norm(s.centre) for s in solids)
    return float(far * tracer.equirect.footprint)


def origins(kind: str, solids: tuple[Solid, ...], rng: np.random.Generator) -> Float:
    centre = np.asarray(solids[0].centre)
    low, high = solids[0].bounds()
    reach = 0.5 * float(np.linalg.norm(high - low))
    if kind == "floor":
        x, z = rng.uniform(-1.8, 1.8, (2, N))
        return np.stack([centre[0] + x, np.full(N, -1.4), centre[2] + z], axis=1)
    if kind == "behind":
        return centre + unit(centre) + 0.3 * random_directions(rng, N)
    return centre + random_directions(rng, N) * rng.uniform(1.5, 4.0, (N, 1)) * reach


@pytest.mark.parametrize("start", ["floor", "behind", "around"])
@pytest.mark.parametrize("projection", ["perspective", "equirect"])
@pytest.mark.parametrize("name", SOLIDS)
def test_hits_what_is_there(tracers: Tracers, name: str, projection: str, start: str) -> None:
    tracer, solids = tracers[name, projection], SOLIDS[name]
    rng = np.random.default_rng(1)
    o = origins(start, solids, rng)
    low, high = solids[0].bounds()
    spread = 0.65 * float(np.linalg.norm(high - low)) * rng.random((N, 1)) ** (1 / 3)
    d = unit(solids[0].centre + spread * random_directions(rng, N) - o)
    o, d = o.astype(np.float32).astype(float), d.astype(np.float32).astype(float)
    hits = tracer(o, d)
    met = np.isfinite(hits.t)
    t = truth(solids, o, d)
    size = footprint(tracer, solids)
    # Texels whose centre misses a solid, or just meets it, are wrong about its rim.
    surely = np.isfinite(truth(solids, o, d, -2.0 * size)) & np.isfinite(t)
    possibly = np.isfinite(truth(solids, o, d, 2.0 * size))
    thin = "plate" in name
    assert possibly.any()
    assert (~possibly).any()
    assert (met & ~possibly).sum() <= 2
    assert (met == np.isfinite(t)).mean() > 0.97
    if not thin:
        assert surely.sum() > 300
        assert (~met & surely).sum() <= 2
    both = met & np.isfinite(t)
    error = np.abs(hits.t[both] - t[both]) / size
    assert np.median(error) < 1.0
    assert np.quantile(error, 0.9) < 2.5
    if name == "ball off screen" and projection == "perspective":
        assert (hits.on_screen[met] == 0).all()
    elif name == "ball half off screen" and projection == "perspective":
        assert 0.1 < (hits.on_screen[met] == 1).mean() < 0.9


@pytest.mark.parametrize("projection", ["perspective", "equirect"])
@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("side", ["front", "back"])
def test_rays_that_leave_a_convex_solid_do_not_meet_it(
    tracers: Tracers, name: str, projection: str, side: str
) -> None:
    """From rasterized points, lifted by two texel footprints along the normal."""
    tracer, solids = tracers[name, projection], SOLIDS[name]
    view = SCREEN if projection == "perspective" and "off screen" not in name else AROUND
    layers = layers_of(solids, view)
    geometry = (layers.front if side == "front" else layers.back).geometry.astype(float)
    v = view.directions()[geometry[..., 3] > 0.0]
    geometry = geometry[geometry[..., 3] > 0.0]
    rng = np.random.default_rng(3)
    pick = rng.integers(0, len(v), N)
    n, r = geometry[pick, :3], geometry[pick, 3:]
    texel = (tracer.screen or tracer.equirect).footprint if view is SCREEN else np.pi / 256
    o = r * v[pick] + 2.0 * texel * r * n
    d = unit(random_directions(rng, N) + n)
    assert np.isfinite(tracer(o, d).t).mean() < 1e-3
    if "plate" not in name:
        # Errors of depth put starts below the surface: what they start in they only leave.
        o -= 3.5 * texel * r * n
        assert np.isfinite(tracer(o, d).t).mean() < 0.1


@pytest.mark.parametrize("projection", ["perspective", "equirect"])
@pytest.mark.parametrize(
    "solid", [Sphere((0.3, 0.2, -0.4), 2.5), Box((0.3, 0.1, -0.2), (1.5, 1.2, 2.0), 0.3)], ids=repr
)
def test_around_the_camera(device: ComputeDevice, projection: str, solid: Solid) -> None:
    """The camera sees the far sides from inside: a shell without thickness, but tight."""
    view = SCREEN if projection == "perspective" else AROUND
    tracer = ObjectTracer(device, view, (solid,), AROUND)
    rng = np.random.default_rng(4)
    o = np.asarray(solid.centre) + random_directions(rng, N) * rng.uniform(0.0, 1.0, (N, 1))
    o[:1000] = 0.0
    d = random_directions(rng, N).astype(float)
    hits = tracer(o, d)
    t = truth((solid,), o, d)
    assert np.isfinite(hits.t).all()
    error = np.abs(hits.t - t)
    # But for texels with an edge of the box in them.
    assert np.quantile(error[:1000], 0.97) < 1e-3
    assert error[:1000].max() < 0.1
    assert np.quantile(error, 0.99) < 3.0 * np.pi / 256 * 2.5 * 2.0
    outside = np.asarray(solid.centre) + 6.0 * random_directions(rng, N)
    assert np.isfinite(tracer(outside, unit(solid.centre - outside)).t).all()


@pytest.mark.parametrize("projection", ["perspective", "equirect"])
@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_scale_changes_no_texel(device: ComputeDevice, projection: str, scale: float) -> None:
    view = SCREEN if projection == "perspective" else AROUND
    small, large = (
        (Sphere(tuple(s * c for c in (0.4, -0.7, -2.0)), 0.4 * s),) for s in (1.0, scale)
    )
    rng = np.random.default_rng(6)
    o = origins("around", small, rng)
    d = unit(small[0].centre + 0.5 * random_directions(rng, N) - o)
    plain = ObjectTracer(device, view, small, AROUND)(o, d)
    other = ObjectTracer(device, view, large, AROUND)(o * scale, d)
    assert 0.2 < np.isfinite(plain.t).mean() < 0.9
    assert (plain.index == other.index).mean() > 0.999


@pytest.mark.parametrize("projection", ["perspective", "equirect"])
def test_nothing_to_meet(device: ComputeDevice, tracers: Tracers, projection: str) -> None:
    rng = np.random.default_rng(7)
    view = SCREEN if projection == "perspective" else AROUND
    empty = ObjectTracer(device, view, (Sphere((0.0, 0.0, -2.0), 1e-4),), AROUND)
    d = random_directions(rng, N)
    assert np.isinf(empty(np.array([0.0, 0.0, -2.0]), d).t).all()
    bad = np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, -1.0], [0.0, np.inf, 0.0], [0.0, 0.0, np.nan]])
    ball = tracers["ball", projection]
    assert np.isinf(ball(np.zeros((4, 3)), bad).t).all()
    up = np.array([[0.0, 0.0, -1.0]] * 3)
    assert np.isinf(ball(bad[1:], up).t).all()


def test_zero_components(tracers: Tracers) -> None:
    """Rays along the axes, through the middle of the ball, from all sides."""
    centre = np.asarray(SOLIDS["ball"][0].centre)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    for projection in ("perspective", "equirect"):
        for zero in (0.0, -0.0):
            d = np.where(axes == 0.0, zero, axes)
            hits = tracers["ball", projection](centre - 1.5 * axes, d)
            assert np.abs(hits.t - 1.1).max() < 0.03
