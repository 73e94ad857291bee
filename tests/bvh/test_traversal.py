"""Triangles and distances that rays meet, against Embree and brute force; moving objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.bvh.scene import SceneBuilder, object_bounds, scene_sizes, shapes_of
from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, Mesh
from tests.bvh.meshes import bumpy, fan, growing, instance_of, same_centres
from tests.bvh.rays import TURN, Float, brute_force, rays_at, transforms, world_triangles
from tests.bvh.tracing import BvhTracer
from tests.kernels.tracing import random_directions
from tests.meshes import mesh_of, sphere, transform


def test_as_embree_sees_it(device: ComputeDevice) -> None:
    """Hits, distances and triangles agree along 100,000 rays at a mesh that is not convex."""
    pytest.importorskip("embreex", reason="needs embreex")
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    instance = instance_of(bumpy(np.random.default_rng(3), 5))
    o, d = rays_at(instance, 100_000)
    met = BvhTracer(device, [instance])(o, d)
    embree = EmbreeScene()
    TriangleMesh(embree, world_triangles(instance).astype(np.float32))
    found = embree.run(o.astype(np.float32), d.astype(np.float32), output=True)
    hit = found["geomID"] >= 0
    assert 0.3 < hit.mean() < 0.9
    differ = hit != np.isfinite(met.t)
    assert differ.sum() <= 3  # rays that graze an edge
    both = hit & ~differ
    away = np.abs(met.t - found["tfar"])[both] > 1e-5
    assert away.sum() <= 3
    ties = met.triangle[both] != found["primID"][both]
    # On a shared edge either triangle is right.
    weights = np.stack([found["u"], found["v"], 1.0 - found["u"] - found["v"]])[:, both]
    assert (ties & (weights.min(axis=0) > 1e-3)).sum() <= 3


def test_one_by_one_as_at_once(device: ComputeDevice) -> None:
    """GPUs take children and triangles one after another, CPUs together: all hits are equal."""
    rng = np.random.default_rng(15)
    mesh = bumpy(rng, 4)
    many = [instance_of(mesh, transform(1.0, rng.normal(size=3) * 4.0), f"{i}") for i in range(20)]
    o, d = 5.0 * rng.normal(size=(20_000, 3)), random_directions(rng, 20_000)
    together, apart = (BvhTracer(device, many, scalar=scalar)(o, d) for scalar in (False, True))
    assert 0.1 < np.isfinite(together.t).mean() < 0.9
    np.testing.assert_array_equal(apart.t, together.t)
    assert (
        (apart.triangle != together.triangle) | (apart.instance != together.instance)
    ).sum() <= 3


@pytest.mark.parametrize("scalar", [False, True])
def test_any_hit_is_found_where_the_nearest_is(device: ComputeDevice, scalar: bool) -> None:
    rng = np.random.default_rng(16)
    instance = instance_of(bumpy(rng, 4))
    o, d = rays_at(instance, 20_000)
    trace = BvhTracer(device, [instance], scalar=scalar)
    reach = rng.uniform(0.0, 6.0, 20_000).astype(np.float32)
    nearest, some = (trace(o, d, reach, any_hit=any_hit) for any_hit in (False, True))
    met = np.isfinite(nearest.t)
    assert 0.1 < met.mean() < 0.9
    np.testing.assert_array_equal(np.isfinite(some.t), met)
    assert (some.t[met] >= nearest.t[met]).all()
    assert (some.t[met] < reach[met]).all()
    assert (some.t > nearest.t).any()


@transforms
def test_transformed_as_brute_force_sees_it(device: ComputeDevice, matrix: Float) -> None:
    instance = instance_of(bumpy(np.random.default_rng(4), 2), matrix)
    o, d = rays_at(instance, 4000)
    met = BvhTracer(device, [instance])(o, d)
    t, triangle = brute_force(instance, o, d)
    reach = np.abs(o).max()
    clear = np.isfinite(met.t) == np.isfinite(t)
    assert (~clear).sum() <= 4
    both = clear & np.isfinite(t)
    assert both.sum() > 800
    assert (np.abs(met.t - t)[both] > 2e-5 * reach).sum() <= 4
    assert (met.triangle != triangle)[both].sum() <= 8


def test_what_lies_behind_a_start_amid_triangles_is_not_hit(device: ComputeDevice) -> None:
    """Boxes that hold the start are entered, whatever side of it their triangles are on."""
    rng = np.random.default_rng(16)
    instance = instance_of(mesh_of(rng.normal(size=(180, 3)), np.arange(180).reshape(-1, 3)))
    o = rng.uniform(-0.7, 0.7, (2000, 3)).astype(np.float32).astype(np.float64)
    d = random_directions(rng, len(o)).astype(np.float32).astype(np.float64)
    met = BvhTracer(device, [instance])(o, d)
    t, triangle = brute_force(instance, o, d)
    assert 0.1 < np.isfinite(t).mean() < 0.999
    assert (met.triangle != triangle).sum() <= 3
    same = (met.triangle == triangle) & np.isfinite(t)
    np.testing.assert_allclose(met.t[same], t[same], rtol=1e-3, atol=1e-5)


def test_refitted_equals_rebuilt(device: ComputeDevice) -> None:
    """Moved vertices in the old tree give the hits of a new one."""
    before = bumpy(np.random.default_rng(9), 4)
    positions = (
        before.positions * [1.0, 0.3, 2.0] + np.sin(3.0 * before.positions[:, ::-1])
    ).astype(np.float32)
    after = replace(before, positions=positions)
    o, d = rays_at(instance_of(after), 20_000)
    moving = BvhTracer(device, [instance_of(before)])
    before_hits = moving(o, d)
    tree = moving.scene.slots.copy()
    moving.load([instance_of(after)])
    np.testing.assert_array_equal(moving.scene.slots, tree)
    refitted, rebuilt = moving(o, d), BvhTracer(device, [instance_of(after)])(o, d)
    assert np.isfinite(rebuilt.t).mean() > 0.1
    assert not np.array_equal(before_hits.t, rebuilt.t)
    np.testing.assert_array_equal(refitted.t, rebuilt.t)
    ties = refitted.triangle != rebuilt.triangle
    assert ties.mean() < 1e-3


def test_objects_move(device: ComputeDevice) -> None:
    """Only the tree over instances is new; which is hit, and with which material, is right."""
    mesh = sphere(3, materials=(Material(albedo=(0.1, 0.2, 0.3)),))
    rng = np.random.default_rng(10)

    def scattered() -> list[Instance]:
        return [
            instance_of(mesh, transform(rng.uniform(0.2, 0.5), rng.normal(size=3) * 5.0), f"{i}")
            for i in range(200)
        ]

    first = scattered()
    tracer = BvhTracer(device, first)
    for instances in (first, scattered()):
        tracer.load(instances)
        centres = np.array([i.to_world[:3, 3] for i in instances])
        radii = np.array([i.to_world[0, 0] for i in instances])
        o = rng.normal(size=(3000, 3)) * 5.0
        d = random_directions(rng, 3000).astype(np.float64)
        met = tracer(o, d)
        gap = o[:, None] - centres
        b = (gap * d[:, None]).sum(-1)
        root = b * b - (gap * gap).sum(-1) + radii**2
        near, far = -b - np.sqrt(np.maximum(root, 0.0)), -b + np.sqrt(np.maximum(root, 0.0))
        t = np.where(
            root > 0.0, np.where(near > 0.0, near, np.where(far > 0.0, far, np.inf)), np.inf
        )
        nearest = np.where(np.isfinite(t.min(1)), t.argmin(1), -1)
        assert (nearest != met.instance).mean() < 0.01  # triangles lie within the sphere
        agree = (nearest == met.instance) & (nearest >= 0)
        assert agree.sum() > 100
        np.testing.assert_array_equal(met.material[agree], nearest[agree])
        assert np.median(np.abs(met.t - t.min(1))[agree]) < 0.01


@pytest.mark.parametrize("mesh", [same_centres(500), fan(500), growing(40)])
def test_nasty_meshes_as_brute_force_sees_them(device: ComputeDevice, mesh: Mesh) -> None:
    instance = instance_of(mesh)
    rng = np.random.default_rng(11)
    corners = world_triangles(instance)
    target = corners[rng.integers(len(corners), size=3000)].mean(axis=1)
    away = np.maximum(np.abs(target).max(axis=1, keepdims=True), 0.1)
    o = (target + np.array([0.03, 0.02, 0.2]) * away).astype(np.float32)
    d = target - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    met = BvhTracer(device, [instance])(o, d)
    t, _ = brute_force(instance, o.astype(np.float64), d.astype(np.float32).astype(np.float64))
    assert np.isfinite(met.t).all()
    np.testing.assert_allclose(met.t, t, rtol=1e-4)


def test_degenerate_triangles_are_never_hit(device: ComputeDevice) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [np.nan, 0, 0], [np.inf, 1, 0], [0, 1, 0]])
    triangles = [[0, 0, 0], [0, 1, 1], [0, 1, 2], [0, 1, 3], [0, 1, 4]]
    o = np.concatenate([points[:3]] * 20) + np.random.default_rng(12).normal(size=(60, 3))
    d = np.concatenate([points[:3]] * 20) - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    assert not np.isfinite(
        BvhTracer(device, [instance_of(mesh_of(points, triangles))])(o, d).t
    ).any()
    # One good triangle among them is met as if alone.
    alone = BvhTracer(device, [instance_of(mesh_of(points, [[0, 1, 5]]))])(o, d)
    among = BvhTracer(device, [instance_of(mesh_of(points, [*triangles, [0, 1, 5]]))])(o, d)
    assert np.isfinite(alone.t).any()
    np.testing.assert_array_equal(among.t, alone.t)


def test_without_triangles_nothing_is_hit(device: ComputeDevice) -> None:
    empty = instance_of(mesh_of(np.zeros((0, 3)), np.zeros((0, 3), int)))
    o, d = np.zeros((8, 3)), random_directions(np.random.default_rng(13), 8)
    assert not np.isfinite(BvhTracer(device, [])(o, d).t).any()
    assert not np.isfinite(BvhTracer(device, [empty])(o, d).t).any()
    both = BvhTracer(device, [empty, instance_of(sphere()), empty])(o, d)
    assert np.isfinite(both.t).all()
    np.testing.assert_array_equal(both.instance, 1)


def test_flat_objects_are_hit(device: ComputeDevice) -> None:
    """A transform without an inverse: an object pressed flat."""
    flat = instance_of(sphere(4), transform(TURN @ np.diag([1.0, 0.0, 1.0]), (0.2, 0.1, -2.0)))
    d = flat.to_world[:3, 3] + TURN @ (0.3 * np.array([1.0, 0.0, 0.5])) + np.zeros((1, 3))
    t = float(np.linalg.norm(d))
    met = BvhTracer(device, [flat])(np.zeros((1, 3)), d / t)
    np.testing.assert_allclose(met.t, t, rtol=1e-5)
    np.testing.assert_allclose(np.abs(met.normal[0] @ TURN[:, 1]), 1.0, atol=1e-3)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 0.0])
def test_what_is_no_ray_hits_nothing(device: ComputeDevice, bad: float) -> None:
    tracer = BvhTracer(device, [instance_of(sphere())])
    d = np.full((4, 3), bad)
    assert not np.isfinite(tracer(np.zeros((4, 3)), d).t).any()
    if bad != 0.0:
        forward = np.broadcast_to([0.0, 0.0, 1.0], (4, 3))
        assert not np.isfinite(tracer(np.full((4, 3), bad), forward).t).any()


def test_the_end_of_the_ray_counts(device: ComputeDevice) -> None:
    tracer = BvhTracer(device, [instance_of(sphere(4))])
    d = random_directions(np.random.default_rng(14), 200)
    full = tracer(np.zeros((200, 3)), d)
    assert np.isfinite(full.t).all()
    assert not np.isfinite(tracer(np.zeros((200, 3)), d, full.t).t).any()
    np.testing.assert_array_equal(tracer(np.zeros((200, 3)), d, full.t * 1.001).t, full.t)


def test_a_shared_tree_becomes_two(device: ComputeDevice) -> None:
    """One of two objects is flattened and has no inverse in the space of their mesh."""
    mesh = sphere(3, materials=(Material(),))
    near, far = (instance_of(mesh, transform(1.0, (x, 0.0, 0.0)), f"{x}") for x in (-2.0, 2.0))
    tracer = BvhTracer(device, [near, far])
    flat = replace(far, to_world=far.to_world @ np.diag([1.0, 1.0, 0.0, 1.0]))
    o = np.array([[-2.0, 0.1, 5.0], [2.0, 0.1, 5.0]])
    d = np.tile([[0.0, 0.0, -1.0]], (2, 1))
    np.testing.assert_allclose(tracer(o, d).t, 5.0 - np.sqrt(1.0 - 0.01), atol=0.02)
    tracer.load([near, flat])
    met = tracer(o, d)
    np.testing.assert_array_equal(met.instance, [0, 1])
    np.testing.assert_allclose(met.t, [5.0 - np.sqrt(1.0 - 0.01), 5.0], atol=0.02)


def test_buffers_are_planned_large_enough() -> None:
    instances = [instance_of(sphere(2)), instance_of(sphere(1))]
    planned, built = scene_sizes(shapes_of(instances)), SceneBuilder().build(instances)
    for name in ("nodes", "packets", "instances"):
        assert getattr(planned, name) >= len(getattr(built, name))


def test_boxes_of_objects_hold_them_with_a_margin() -> None:
    """The margin is a share of the box's diagonal."""
    instance = instance_of(sphere(2), transform(0.7 * TURN, (0.3, -0.2, 0.5)))
    points = world_triangles(instance).reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    size = 0.1 * np.linalg.norm(high - low)
    (box,) = object_bounds([instance], margin=0.1)
    np.testing.assert_allclose(box[0, :3], low - size, rtol=1e-5)
    np.testing.assert_allclose(box[1, :3], high + size, rtol=1e-5)
