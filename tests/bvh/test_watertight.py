"""No ray slips between triangles, or through boxes that are flat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from tests.bvh.meshes import bumpy, instance_of
from tests.bvh.rays import Float, transforms, world_triangles
from tests.bvh.tracing import BvhTracer
from tests.meshes import mesh_of


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
    """Distances to both sides of a box round to the same value: every slab is a plane."""
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
