"""Rays behind the first layer, where earlier frames have shown a surface: what is true there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.settings.trace import LearningSettings, TraceSettings
from iprt.world.real.panorama import Panorama
from tests.kernels.tracing import UNKNOWN, build, four, random_directions
from tests.oracles.worlds import Box, World
from tests.worlds import Float, bright_walls, filmed, pose_at

KERNEL = """
#include "maths/grid.h"
#include "world/scene.h"
__kernel void trace(const int n, const float t_max, __global const float4 *origin,
                    __global const float4 *direction, __global float4 *found,
                    __global float4 *shown, REAL_PARAMETERS WORK_PARAMETER)
{
    const int i = get_global_id(0);
    if (i >= n)
        return;
    RealLayer layer = REAL_LAYER;
    RealHit hit = trace_real_layer(layer, origin[i].xyz, direction[i].xyz, t_max);
    found[i] = (float4)(hit.direction, hit.t);
#ifdef LEARNED_HIDDEN
    shown[i] = (float4)(hit.kind == HIT_LEARNED ? hit.learned : (float3)(0.0f), hit.kind);
#else
    shown[i] = (float4)((float3)(0.0f), hit.kind);
#endif
}
"""
LEARNED = UNKNOWN + 1
PANEL = Box((0.0, 0.0, -1.2), (0.4, 0.4, 0.01))
CRATE = Box((0.0, -0.2, -1.2), (0.4, 0.4, 0.3))
EMPTY = World()
HOME, ELSEWHERE = pose_at(), pose_at((0.35, 0.15, 0.1), 35.0, 10.0)
LEARNING = LearningSettings(samples=32768)


@dataclass(frozen=True)
class Found:
    """What rays met: distance (N,), kind (N,), and radiance (N, 3) of what was learned."""

    t: Float
    kind: NDArray[np.int64]
    radiance: Float


def crate_color(points: Float, normals: Float) -> Float:
    """The crate's back is green, its other sides are black."""
    inside = (np.abs(points - CRATE.centre) < np.array(CRATE.half) + 1e-3).all(-1)[..., None]
    back = np.where(normals[..., 2:] < -0.9, [0.0, 1.0, 0.0], 0.0)
    return np.where(inside, back, bright_walls(points, normals))


def seen(world: World, pose: Float = HOME) -> Frame:
    return filmed(world, 256, 128, crate_color, pose)


def learned_of(
    device: ComputeDevice, frame: Frame, *before: Frame, background: bool = False
) -> Panorama:
    """The frame's panorama, after radiance was learned from it and those before."""
    panorama = Panorama(
        device, frame.width, frame.height,
        learning=LEARNING, background=TraceSettings() if background else None,
    )  # fmt: skip
    assert panorama.learned is not None
    for index, shown in enumerate((*before, frame)):
        panorama.load(shown)
        panorama.remember(forget=index == 0)
        texels, first = panorama.width * panorama.height, index == 0
        panorama.learned.follow(shown.pose, texels=texels, scale=panorama.scale, forget=first)
        for _ in range(4):
            panorama.learn()
    return panorama


def traced(
    device: ComputeDevice, panorama: Panorama, o: Float, d: Float, *options: str,
    back_faces: bool = False, pose: Float = HOME, t_max: float = np.inf,
) -> Found:  # fmt: skip
    """Trace (N, 3) rays, in the world's axes, through the panorama of a frame with this pose."""
    kernel = build(device, KERNEL, "trace", *options)
    trace = TraceSettings(thickness=0.05, thickness_ratio=0.05, back_faces=back_faces)
    found, shown = (device.empty(name, (len(d), 4)) for name in ("found", "shown"))
    kernel(
        (len(d),), panorama.arguments(trace), n=len(d), t_max=t_max, found=found, shown=shown,
        origin=device.upload("o", four((o - pose[:3, 3]) @ pose[:3, :3])),
        direction=device.upload("d", four(d @ pose[:3, :3])),
    )  # fmt: skip
    f, s = device.read(found).astype(np.float64), device.read(shown).astype(np.float64)
    return Found(f[:, 3], s[:, 3].astype(int), s[:, :3])


def hidden(solid: Box, pose: Float, points: Float, margin: float) -> NDArray[np.bool_]:
    """Does the solid hide the points (N, 3), well within its outline and well behind it?"""
    centre = pose[:3, 3]
    way = points - centre
    r = np.linalg.norm(way, axis=-1)
    smaller = replace(solid, half=(solid.half[0] - margin, solid.half[1] - margin, solid.half[2]))
    enter, *_ = smaller.interval(centre, way / r[:, None])
    return np.asarray(np.isfinite(enter) & (enter > 0.0) & (enter < 0.85 * r))


def rays_behind(rng: np.random.Generator, n: int = 40_000) -> tuple[Float, Float]:
    """From the space behind the panel and beside it."""
    o = rng.uniform((-1.5, -1.0, -2.3), (1.5, 1.0, -1.6), (n, 3))
    return o.astype(np.float32).astype(float), random_directions(rng, n).astype(float)


@pytest.mark.parametrize("pose", [HOME, ELSEWHERE], ids=["stays", "moves"])
def test_rays_meet_the_wall_behind_a_panel(device: ComputeDevice, pose: Float) -> None:
    """Where it truly is, in its true colour, if an earlier frame has shown it."""
    panorama = learned_of(device, seen(World(solids=(PANEL,)), pose), seen(EMPTY))
    o, d = rays_behind(np.random.default_rng(1))
    world = World(solids=(PANEL,))
    t, normal, which = world.first_hit(o, d)
    end = o + t[:, None] * d
    # What lies close to an edge of the room has several walls around.
    inner = np.sort(np.minimum(end - world.low, world.high - end), axis=1)[:, 1] > 0.25
    sure = hidden(PANEL, pose, end, 0.1) & (which == 0) & inner & (-(normal * d).sum(-1) > 0.1)
    assert sure.sum() > 500
    with_ = traced(device, panorama, o, d, "-DLEARNED_HIDDEN", back_faces=True, pose=pose)
    without = traced(device, panorama, o, d, back_faces=True, pose=pose)
    met = sure & (with_.kind == LEARNED)
    assert met.sum() > 0.97 * sure.sum()
    assert np.quantile(np.abs(with_.t - t)[met], 0.99) < 2e-3
    wanted = bright_walls(end, normal)
    assert np.quantile(np.abs(with_.radiance - wanted)[met], 0.95) < 0.06
    wrong = np.abs(np.where(np.isfinite(without.t), without.t, 1e9) - t)[sure]
    assert np.median(wrong) > 0.05


def test_backs_of_thin_things_are_met(device: ComputeDevice) -> None:
    """Within the thickness that is assumed of what the frame shows, too."""
    behind, turned = pose_at((0.0, 0.0, -2.2)), pose_at((0.0, 0.0, 0.0), 120.0)
    panel = Box(CRATE.centre, (0.4, 0.4, 0.01))
    for thing in (CRATE, panel):
        world = World(solids=(thing,))
        panorama = learned_of(device, seen(world, turned), seen(world, behind))
        rng = np.random.default_rng(2)
        aim = rng.uniform((-0.25, -0.45, -1.2 - thing.half[2]), (0.25, 0.05, -1.2), (2000, 3))
        aim[:, 2] = -1.2 - thing.half[2]
        o = aim + rng.uniform((-0.3, -0.3, -0.7), (0.3, 0.3, -0.3), aim.shape)
        t = np.linalg.norm(aim - o, axis=1)
        d = (aim - o) / t[:, None]
        found = traced(device, panorama, o, d, "-DLEARNED_HIDDEN", pose=turned)
        met = found.kind == LEARNED
        assert met.mean() > 0.95
        assert np.quantile(np.abs(found.t - t)[met], 0.95) < 0.02
        if thing is CRATE:
            assert np.median(np.abs(found.radiance - [0.0, 1.0, 0.0])[met]) < 0.02


def test_nothing_is_met_where_the_frame_shows_that_nothing_is(device: ComputeDevice) -> None:
    """A panel that has gone leaves no models in the free space where it stood."""
    panorama = learned_of(device, seen(EMPTY), seen(World(solids=(PANEL,))))
    rng = np.random.default_rng(3)
    o = rng.uniform(0.97 * np.array(EMPTY.low), 0.97 * np.array(EMPTY.high), (40_000, 3))
    d = random_directions(rng, len(o)).astype(float)
    with_ = traced(device, panorama, o, d, "-DLEARNED_HIDDEN", back_faces=True)
    without = traced(device, panorama, o, d, back_faces=True)
    np.testing.assert_array_equal(with_.t, without.t)
    np.testing.assert_array_equal(with_.kind, without.kind)


def test_without_anything_learned_nothing_changes(device: ComputeDevice) -> None:
    """The back faces that are assumed among it."""
    panorama = learned_of(device, seen(World(solids=(CRATE,))))
    assert panorama.learned is not None
    panorama.learned.learner.forget()
    o, d = rays_behind(np.random.default_rng(4))
    with_ = traced(device, panorama, o, d, "-DLEARNED_HIDDEN", back_faces=True)
    without = traced(device, panorama, o, d, back_faces=True)
    # Beyond its back face, a ray goes through a few texels more before it is given up.
    np.testing.assert_array_equal(with_.t, without.t)
    np.testing.assert_array_equal(with_.kind, without.kind)


def test_what_is_remembered_counts_more(device: ComputeDevice) -> None:
    """Of a camera that stays: the memory shows the wall, and models do not stand before it."""
    panorama = learned_of(device, seen(World(solids=(PANEL,))), seen(EMPTY), background=True)
    o, d = rays_behind(np.random.default_rng(5))
    both = traced(device, panorama, o, d, "-DLEARNED_HIDDEN", "-DBACKGROUND")
    memory = traced(device, panorama, o, d, "-DBACKGROUND")
    assert (both.kind == LEARNED).mean() < 0.02
    same = both.kind != LEARNED
    np.testing.assert_array_equal(both.t[same], memory.t[same])


def test_rays_end_where_they_are_told_to(device: ComputeDevice) -> None:
    panorama = learned_of(device, seen(World(solids=(PANEL,))), seen(EMPTY))
    o, d = rays_behind(np.random.default_rng(6), 5000)
    found = traced(device, panorama, o, d, "-DLEARNED_HIDDEN", t_max=0.6)
    met = found.kind == LEARNED
    assert met.sum() > 50
    assert found.t[met].max() <= 0.6
