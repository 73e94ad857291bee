"""The points, normals and colors where rays meet triangles, and rays that go on from there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from tests.bvh.meshes import instance_of
from tests.bvh.rays import TRANSFORMS, Float, rays_at, transforms, world_triangles
from tests.bvh.tracing import BvhTracer, Met
from tests.kernels.tracing import random_directions
from tests.meshes import mesh_of, sphere, transform


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
        instance_of(sphere(2), transform(0.1, (0.0, 0.0, 50.0))),
        *(
            instance_of(textured(image), transform(1.0, (2.0 * i, 0.0, 0.0)))
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
