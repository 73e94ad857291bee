"""Back faces that the panorama does not show (IPRT Figure 4), against the paper's construction."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.equirect import equirect_pixel
from iprt.world.real.panorama import Panorama
from tests.kernels.tracing import BACK_FACE, SURFACE, RealTracer, panorama_of
from tests.oracles.worlds import Box, World

WIDTH, HEIGHT = 512, 256
FACE = -2.0
DESK = Box((0.0, 0.0, FACE - 0.5), (0.5, 0.6, 0.5))
"""Only its front, z = -2, is seen from the centre: the gaps beside it are those of Figure 4."""
WORLD = World((-4.0, -3.0, -6.0), (4.0, 3.0, 3.0), (DESK,))

Float = NDArray[np.float64]


@pytest.fixture(scope="module")
def panorama(device: ComputeDevice) -> Panorama:
    return panorama_of(device, WORLD.frame(WIDTH, HEIGHT))


@pytest.fixture(scope="module")
def aware(device: ComputeDevice) -> RealTracer:
    return RealTracer(device, bassrt=True)


def right_edge() -> float:
    """Azimuth of the edge between the last column that shows the desk and the wall beside it."""
    column = (np.arange(WIDTH) + 0.5) / WIDTH * 2.0 * np.pi - np.pi
    shows = np.abs(np.tan(column)) * -FACE < 0.5
    last = np.flatnonzero(shows & (np.abs(column) < 1.0))[-1]
    return float((last + 1) / WIDTH * 2.0 * np.pi - np.pi)


def rays_into_the_gap(n: int, seed: int) -> tuple[Float, Float, Float]:
    """Rays from beside the desk through the half plane behind its right edge, and where."""
    rng = np.random.default_rng(seed)
    phi = right_edge()
    reach = rng.uniform(2.3, 3.4, n)  # along the edge's azimuth, past the desk's face
    crossing = np.stack(
        [reach * np.sin(phi), rng.uniform(-0.3, 0.3, n), -reach * np.cos(phi)], axis=1
    )
    o = np.stack([rng.uniform(1.4, 2.2, n), rng.uniform(-0.3, 0.3, n),
                  crossing[:, 2] + rng.uniform(-0.5, 0.5, n)], axis=1)  # fmt: skip
    d = crossing - o
    return o, d / np.linalg.norm(d, axis=1, keepdims=True), crossing


def construction(o: Float, d: Float, crossing: Float) -> tuple[Float, Float]:
    """(p', distance to p): Figure 4 for rays that pass the desk's right edge.

    In the plane of the ray and the capture centre e: g1 where the line from e to the crossing
    meets the desk's face, the back face g1 + k w with w perpendicular to the face's trace, p on
    the ray, and p' on the trace with |g1 p'| = |g1 p|.
    """
    points, distances = [], []
    for origin, direction, gap in zip(o, d, crossing, strict=True):
        g1 = gap * (FACE / gap[2])
        plane = np.cross(origin, direction)
        trace = np.cross(plane, [0.0, 0.0, 1.0])
        trace *= -np.sign(trace[0]) / np.linalg.norm(trace)  # leftwards, into the desk
        back = np.cross(plane, trace)
        back *= -np.sign(back[2]) / np.linalg.norm(back)  # away from e
        system = np.stack([direction, -back], axis=1)
        (t, k), *_ = np.linalg.lstsq(system, g1 - origin, rcond=None)
        points.append(g1 + k * trace)
        distances.append(t)
    return np.array(points), np.array(distances)


def texel_of(points: Float) -> Float:
    return equirect_pixel(points, WIDTH, HEIGHT)


def on_face(points: Float, margin: float) -> NDArray[np.bool_]:
    return (np.abs(points[:, :2]) < np.array([0.5, 0.6]) - margin).all(axis=1)


def test_returns_the_texel_of_the_construction(panorama: Panorama, aware: RealTracer) -> None:
    o, d, crossing = rays_into_the_gap(3000, 1)
    hits = aware(panorama, o, d)
    substitute, t = construction(o, d, crossing)
    meant = on_face(substitute, 0.05)
    assert meant.sum() > 300
    assert (hits.kind[meant] == BACK_FACE).all()
    apart = np.abs(
        np.stack([hits.texel % WIDTH + 0.5, hits.texel // WIDTH + 0.5], axis=1)
        - texel_of(substitute)
    )[meant]
    assert apart.max() < 0.51
    direction = substitute / np.linalg.norm(substitute, axis=1, keepdims=True)
    assert np.abs(hits.direction - direction)[meant].max() < 1e-5
    assert np.abs(hits.t - np.maximum(t, np.linalg.norm(crossing - o, axis=1)))[meant].max() < 1e-4


def test_what_something_nearer_hides_is_not_substituted(
    device: ComputeDevice, aware: RealTracer
) -> None:
    o, d, crossing = rays_into_the_gap(3000, 4)
    substitute, _ = construction(o, d, crossing)
    hider = Box((0.15, 0.0, -1.2), (0.06, 0.2, 0.02))
    world = World(WORLD.low, WORLD.high, (DESK, hider))
    hits = aware(panorama_of(device, world.frame(WIDTH, HEIGHT)), o, d)
    shown = substitute / -substitute[:, 2:] * 1.18  # on the front of what is nearer
    inside = np.abs(shown[:, :2] - [0.15, 0.0]) < np.array([0.04, 0.18])
    hidden = on_face(substitute, 0.05) & inside.all(axis=1)
    assert hidden.sum() > 100
    assert (hits.kind[hidden] != BACK_FACE).all()


def test_ray_away_from_the_back_face_goes_on(device: ComputeDevice, aware: RealTracer) -> None:
    """theta <= 0: g1 is no intersection, the ray is traced on to the wall behind."""
    # A small plate whose face recedes to the right: its far end is the edge that rays pass.
    yaw = 0.9
    plate = Box((0.0, 0.0, -2.0), (0.15, 0.6, 0.01), yaw)
    world = World((-4.0, -3.0, -6.0), (4.0, 3.0, 3.0), (plate,))
    inward = np.array([-np.cos(yaw), 0.0, np.sin(yaw)])
    edge = np.array([0.0, 0.0, -2.0]) - 0.15 * inward
    behind = edge * (1.0 + 0.25 / np.linalg.norm(edge))
    n = 400
    d = np.array([-0.25, 0.0, -0.97]) / np.linalg.norm([-0.25, 0.0, -0.97])
    o = behind - 0.4 * d + np.linspace(-0.2, 0.2, n)[:, None] * [0.0, 1.0, 0.0]
    d = np.broadcast_to(d, o.shape)
    assert d[0] @ inward < 0.0
    hits = aware(panorama_of(device, world.frame(WIDTH, HEIGHT)), o, d, 0.05, 0.0)
    t, _, which = world.first_hit(o, d)
    assert (which == 0).all()
    assert (hits.kind == SURFACE).all()
    assert np.abs(hits.t - t).max() < 1e-3
