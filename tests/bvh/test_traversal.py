"""Rays through the hierarchy, against Embree, brute force, and what must not slip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.scene.material import Material
from iprt.scene.mesh import Instance, Mesh
from tests.bvh.meshes import (
    bumpy,
    fan,
    growing,
    instance_of,
    mesh_of,
    placed,
    same_centres,
    sphere,
    turned,
)
from tests.bvh.tracing import BvhTracer, Met
from tests.kernels.tracing import random_directions

Float = NDArray[np.float64]

TURN = turned((1.0, 2.0, -0.5), 73.0)
TRANSFORMS = {
    "as it is": placed(),
    "turned and moved": placed(1.3 * TURN, (1.0, -2.0, 0.5)),
    "mirrored": placed(TURN @ np.diag([-0.7, 0.7, 0.7]), (0.3, 0.2, -2.0)),
    "stretched": placed(TURN @ np.diag([0.2, 1.0, 5.0]), (0.5, 0.0, 3.0)),
    "sheared": placed(TURN @ np.array([[1.0, 6.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])),
    "tiny": placed(1e-3 * TURN, (2e-3, 0.0, 1e-3)),
    "huge": placed(1e4 * TURN, (1e4, 0.0, 2e4)),
}
transforms = pytest.mark.parametrize("matrix", list(TRANSFORMS.values()), ids=list(TRANSFORMS))


def world_triangles(instance: Instance) -> Float:
    """(F, 3, 3) corners."""
    corners = instance.mesh.positions[instance.mesh.triangles].astype(np.float64)
    return np.asarray(corners @ instance.to_world[:3, :3].T + instance.to_world[:3, 3])


def rays_at(instance: Instance, count: int, seed: int = 0) -> tuple[Float, Float]:
    """From around the object to places in it."""
    rng = np.random.default_rng(seed)
    corners = world_triangles(instance).reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    centre, radius = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low)
    origins = (centre + 1.5 * radius * random_directions(rng, count)).astype(np.float32)
    targets = low + (high - low) * rng.random((count, 3))
    directions = targets - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return origins.astype(np.float64), directions.astype(np.float32).astype(np.float64)


def brute_force(triangles: Float, o: Float, d: Float) -> tuple[Float, NDArray[np.int64]]:
    """Nearest distance, inf for none, and triangle, in float64."""
    t, index = np.full(len(d), np.inf), np.full(len(d), -1)
    for number, (a, b, c) in enumerate(triangles):
        e1, e2 = b - a, c - a
        p = np.cross(d, e2)
        det = p @ e1
        with np.errstate(divide="ignore", invalid="ignore"):
            s = o - a
            u = (s * p).sum(-1) / det
            q = np.cross(s, e1)
            v = (d * q).sum(-1) / det
            along = q @ e2 / det
        hit = (det != 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (along > 0.0) & (along < t)
        t[hit], index[hit] = along[hit], number
    return t, index


def test_as_embree_sees_it(device: ComputeDevice) -> None:
    """The same hits, distances and triangles along 100,000 rays at a mesh that is not convex."""
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


@transforms
def test_transformed_as_brute_force_sees_it(device: ComputeDevice, matrix: Float) -> None:
    instance = instance_of(bumpy(np.random.default_rng(4), 2), matrix)
    o, d = rays_at(instance, 4000)
    met = BvhTracer(device, [instance])(o, d)
    t, triangle = brute_force(world_triangles(instance), o, d)
    reach = np.abs(o).max()
    clear = np.isfinite(met.t) == np.isfinite(t)
    assert (~clear).sum() <= 4
    both = clear & np.isfinite(t)
    assert both.sum() > 800
    assert (np.abs(met.t - t)[both] > 2e-5 * reach).sum() <= 4
    assert (met.triangle != triangle)[both].sum() <= 8


@transforms
def test_points_and_normals(device: ComputeDevice, matrix: Float) -> None:
    """Just off the surface, on the side that is seen; normals by the inverse transpose."""
    mesh = sphere(4)
    instance = instance_of(mesh, matrix)
    o, d = rays_at(instance, 4000)
    met = BvhTracer(device, [instance])(o, d)
    hit = np.isfinite(met.t)
    o, d = o[hit], d[hit]
    there = o + met.t[hit, None] * d
    object_point = (there - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T
    triangles = world_triangles(instance)[met.triangle[hit]]
    flat = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    flat *= -np.sign((flat * d).sum(1, keepdims=True))
    off = ((met.position[hit] - triangles[:, 0]) * flat).sum(1)
    reach = np.abs(triangles).max()
    assert (off > 0.0).all()
    assert (off < 4e-3 * reach).all()  # smooth normals tell of a bulge
    sharp = instance_of(replace(mesh, normals=np.zeros_like(mesh.normals)), matrix)
    off = ((BvhTracer(device, [sharp])(o, d).position - triangles[:, 0]) * flat).sum(1)
    assert (off > 0.0).all()
    assert (off < 1e-5 * reach).all()
    np.testing.assert_allclose(met.flat_normal[hit], flat, atol=2e-3)
    # On the sphere the point is its own normal.
    outward = object_point @ np.linalg.inv(matrix[:3, :3])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    seen = (outward * d).sum(1) < -0.1
    assert seen.mean() > 0.5
    assert np.percentile(np.abs(met.normal[hit] - outward)[seen], 99.9) < 0.02
    assert ((met.normal[hit] * d).sum(1) < 1e-6).all()
    np.testing.assert_allclose(np.linalg.norm(met.normal[hit], axis=1), 1.0, atol=1e-5)


@transforms
def test_nothing_slips_between_triangles(device: ComputeDevice, matrix: Float) -> None:
    """Rays from within a closed mesh at its very edges and corners."""
    mesh = bumpy(np.random.default_rng(5), 3)
    instance = instance_of(mesh, matrix)
    corners = world_triangles(instance)
    centre = np.float32(matrix[:3, 3]).astype(np.float64)
    rng = np.random.default_rng(6)
    weight = rng.random((len(corners), 8, 1))
    edge = corners[:, None, 0] * weight + corners[:, None, 1] * (1.0 - weight)
    halfway = 0.5 * (corners + np.roll(corners, 1, axis=1))
    targets = np.concatenate([corners.reshape(-1, 3), halfway.reshape(-1, 3), edge.reshape(-1, 3)])
    directions = targets - centre
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    met = BvhTracer(device, [instance])(centre, directions)
    assert np.isfinite(met.t).all()
    # And along the axes, where products vanish.
    size = 0.2 * np.abs(matrix[:3, :3]).max()
    inside = centre + size * rng.normal(size=(64, 3)) * 0.05
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        axes = np.broadcast_to(axis, inside.shape)
        assert np.isfinite(BvhTracer(device, [instance])(inside, axes).t).all()


def grid(cells: int) -> tuple[Float, NDArray[np.int64]]:
    """Vertices at integers in the plane z = 0, and triangles."""
    x, y = np.meshgrid(np.arange(cells + 1.0), np.arange(cells + 1.0))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    row = cells + 1
    corner = (np.arange(cells)[:, None] * row + np.arange(cells)).ravel()
    lower = np.stack([corner, corner + 1, corner + row + 1], axis=1)
    upper = np.stack([corner, corner + row + 1, corner + row], axis=1)
    return points, np.concatenate([lower, upper])


def test_along_the_edges_of_a_grid(device: ComputeDevice) -> None:
    """Perpendicular to a plane, exactly at its vertices and edges, with zeros of both signs."""
    points, triangles = grid(8)
    tracer = BvhTracer(device, [instance_of(mesh_of(points, triangles))])
    at = np.concatenate(
        [points, 0.5 * (points[triangles] + points[np.roll(triangles, 1, 1)]).reshape(-1, 3)]
    )
    for zero in (0.0, -0.0):
        for down in (1.0, -1.0):
            o = at - np.array([0.0, 0.0, 3.0 * down])
            d = np.broadcast_to([zero, -zero, down], at.shape)
            np.testing.assert_array_equal(tracer(o, d).t, 3.0)


def test_flat_boxes_are_hit_from_afar(device: ComputeDevice) -> None:
    """Where distances to both sides of a box round to the same: every slab is that of a plane."""
    rng = np.random.default_rng(17)
    points, triangles = grid(8)
    tracer = BvhTracer(device, [instance_of(mesh_of(points / 4.0 - [1.0, 1.0, 0.0], triangles))])
    for distance in (30.0, 1e3, 1e4):
        target = rng.uniform(-0.9, 0.9, (20_000, 3)) * [1.0, 1.0, 0.0]
        away = rng.normal(size=target.shape)
        away[:, 2] = np.abs(away[:, 2]) + 0.1
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        met = tracer((target + distance * away).astype(np.float32), -away)
        inner = np.abs(met.position[:, :2]).max(axis=1) < 0.97
        assert inner.mean() > 0.9
        assert np.isfinite(met.t).all()
        np.testing.assert_allclose(met.t, distance, rtol=1e-5)


@transforms
def test_rays_leave_what_they_have_hit(device: ComputeDevice, matrix: Float) -> None:
    """Off a convex object nothing of it is met again; through its flat side all is."""
    instance = instance_of(sphere(5), matrix)
    o, d = rays_at(instance, 4000, seed=7)
    tracer = BvhTracer(device, [instance])
    met = tracer(o, d)
    hit = np.isfinite(met.t)
    start, flat = met.position[hit], met.flat_normal[hit]
    away = random_directions(np.random.default_rng(8), len(start))
    away *= np.sign((away * flat).sum(1, keepdims=True))
    assert hit.sum() > 800
    # A sphere of triangles is convex; grazing rays may meet a neighbour that rounding tilts.
    steep = (away * flat).sum(1) > 1e-3
    assert not np.isfinite(tracer(start, away).t)[steep].any()
    into = tracer(start, -flat)
    assert np.isfinite(into.t).all()
    assert (into.t < 1e-3 * np.abs(start).max()).all()


def test_a_ball_of_triangles_does_not_shade_itself(device: ComputeDevice) -> None:
    """Rays above the smooth surface start where the coarse one is not in their way."""
    rng = np.random.default_rng(18)
    for coarse in (1, 2, 3):
        instance = instance_of(sphere(coarse), TRANSFORMS["turned and moved"])
        o, d = rays_at(instance, 4000)
        tracer = BvhTracer(device, [instance])
        met = tracer(o, d)
        # Near the silhouette normals are turned towards the viewer.
        front = np.isfinite(met.t) & ((met.normal * d).sum(1) < -0.3)
        start, normal = met.position[front], met.normal[front]
        away = random_directions(rng, len(start))
        away *= np.sign((away * normal).sum(1, keepdims=True))
        below = (away * met.flat_normal[front]).sum(1) < 0.0
        assert below.sum() > 5
        steep = (away * normal).sum(1) > 1e-3
        assert not np.isfinite(tracer(start, away).t)[steep].any()


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
            instance_of(mesh, placed(rng.uniform(0.2, 0.5), rng.normal(size=3) * 5.0), f"{i}")
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
    t, _ = brute_force(corners, o.astype(np.float64), d.astype(np.float32).astype(np.float64))
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
    flat = instance_of(sphere(4), placed(TURN @ np.diag([1.0, 0.0, 1.0]), (0.2, 0.1, -2.0)))
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


@pytest.mark.parametrize("factor", [1e-3, 1e4])
def test_any_unit_of_length(device: ComputeDevice, factor: float) -> None:
    instance = instance_of(bumpy(np.random.default_rng(15), 4), placed(TURN, (1.0, 0.5, -2.0)))
    o, d = rays_at(instance, 5000)
    met = BvhTracer(device, [instance])(o, d)
    larger = replace(instance, to_world=placed(factor) @ instance.to_world)
    other = BvhTracer(device, [larger])(o * factor, d)
    assert (np.isfinite(met.t) != np.isfinite(other.t)).sum() <= 3
    assert (met.triangle != other.triangle).sum() <= 5
    both = np.isfinite(met.t) & np.isfinite(other.t)
    np.testing.assert_allclose(other.t[both], factor * met.t[both], rtol=1e-4)


def textured(image: NDArray[np.float32]) -> Mesh:
    """A square in z = 0 with uv twice the position."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)
    material = Material(albedo=(0.5, 1.0, 0.25), texture=image)
    return mesh_of(points, [[0, 1, 2], [0, 2, 3]], (material,), uvs=2.0 * points[:, :2] - 0.5)


def test_textures(device: ComputeDevice) -> None:
    """Bilinear, repeated, row 0 at v = 1; each material its own."""
    rng = np.random.default_rng(16)
    images = [rng.random((4, 7, 3), np.float32), rng.random((5, 3, 3), np.float32)]
    instances = [
        instance_of(sphere(2), placed(0.1, (0.0, 0.0, 50.0))),
        *(
            instance_of(textured(image), placed(1.0, (2.0 * i, 0.0, 0.0)))
            for i, image in enumerate(images)
        ),
    ]
    tracer = BvhTracer(device, instances)
    for i, image in enumerate(images):
        place = rng.random((500, 3)) * [1.0, 1.0, 0.0]
        o = place + np.array([2.0 * i, 0.0, 1.0])
        met = tracer(o, np.broadcast_to([0.0, 0.0, -1.0], o.shape))
        np.testing.assert_allclose(met.t, 1.0, rtol=1e-6)
        height, width = image.shape[:2]
        u, v = (2.0 * place[:, :2] - 0.5).T
        x, y = u * width - 0.5, (1.0 - v) * height - 0.5
        x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
        fx, fy = (x - x0)[:, None], (y - y0)[:, None]
        corner = [[image[(y0 + b) % height, (x0 + a) % width] for a in (0, 1)] for b in (0, 1)]
        upper = corner[0][0] * (1.0 - fx) + corner[0][1] * fx
        lower = corner[1][0] * (1.0 - fx) + corner[1][1] * fx
        wanted = (upper * (1.0 - fy) + lower * fy) * [0.5, 1.0, 0.25]
        np.testing.assert_allclose(met.albedo, wanted, atol=2e-3)


def test_normals_that_face_away_are_turned(device: ComputeDevice) -> None:
    """The shading normal is towards the viewer and not below the triangle, from both sides."""
    coarse = sphere(1)
    o, d = rays_at(instance_of(coarse), 4000)
    inverted = replace(coarse, normals=-coarse.normals)
    met: list[Met] = [BvhTracer(device, [instance_of(mesh)])(o, d) for mesh in (coarse, inverted)]
    hit = np.isfinite(met[0].t)
    for seen in met:
        assert ((seen.normal * d).sum(1)[hit] < 1e-6).all()
        assert ((seen.normal * seen.flat_normal).sum(1)[hit] > -1e-6).all()
    np.testing.assert_allclose(met[0].normal, met[1].normal, atol=1e-5)
