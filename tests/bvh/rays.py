"""Rays at meshes under many transforms, and their intersections by brute force."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.geometry.mesh import Instance
from tests.bvh.meshes import turned
from tests.kernels.tracing import random_directions
from tests.meshes import transform
from tests.oracles.raster import cast, gather

Float = NDArray[np.float64]

TURN = turned((1.0, 2.0, -0.5), 73.0)
TRANSFORMS = {
    "as it is": transform(),
    "turned and moved": transform(1.3 * TURN, (1.0, -2.0, 0.5)),
    "mirrored": transform(TURN @ np.diag([-0.7, 0.7, 0.7]), (0.3, 0.2, -2.0)),
    "stretched": transform(TURN @ np.diag([0.2, 1.0, 5.0]), (0.5, 0.0, 3.0)),
    "sheared": transform(TURN @ np.array([[1.0, 6.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])),
    "tiny": transform(1e-3 * TURN, (2e-3, 0.0, 1e-3)),
    "huge": transform(1e4 * TURN, (1e4, 0.0, 2e4)),
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


def brute_force(instance: Instance, o: Float, d: Float) -> tuple[Float, NDArray[np.int64]]:
    """Return the nearest distance, inf for none, and triangle, in float64."""
    hits = cast(gather([instance]), d, o)
    return hits.distance, hits.triangle
