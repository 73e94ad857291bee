"""A sequence of a Mitsuba scene, and the panorama at a point of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MAX_DEPTH = 12


def traced(mi: Any, scene: Any, origin: Array, directions: Array, spp: int, seed: int) -> Array:
    """Radiance (..., 3) along rays, the mean of `spp` paths each."""
    import drjit as dr

    paths = mi.load_dict({"type": "path", "max_depth": MAX_DEPTH})
    rays = np.repeat(directions.reshape(-1, 3), spp, axis=0)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, len(rays))
    color, _, _ = paths.sample(scene, sampler, _rays(mi, origin, rays))
    values = np.asarray(dr.ravel(color), np.float64).reshape(-1, spp, 3)
    return values.mean(axis=1).reshape(*directions.shape)


def distances(mi: Any, scene: Any, origin: Array, directions: Array) -> Array:
    """Distance (...) along rays in lengths of the direction; 0 where nothing is met."""
    flat = directions.reshape(-1, 3)
    t = np.asarray(scene.ray_intersect(_rays(mi, origin, flat)).t, np.float64)
    t = np.where(np.isfinite(t), t, 0.0) / np.linalg.norm(flat, axis=-1)
    return t.reshape(directions.shape[:-1])


def _rays(mi: Any, origin: Array, directions: Array) -> Any:
    unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    return mi.Ray3f(mi.Point3f(*map(float, origin)), mi.Vector3f(*unit.T.astype(np.float32)))
