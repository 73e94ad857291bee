"""Normals and smoothed depth of a depth picture, from planes fitted to each pixel's neighbours.

See section 5 of *Natural Environment Illumination*: least squares in the best conditioned of three
parametrisations, without a singular value decomposition.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

REACH = 2
"""Number of neighbours on each side."""
COLUMNS = 320
"""Width up to which adjacent pixels are neighbours; in wider pictures they are further apart."""
SAME_SURFACE_M, SAME_SURFACE = 0.1, 0.05
"""Absolute and relative difference in depth from which neighbours belong to another surface."""
MIN_SHARE = 0.5
"""Least share of neighbours on the same surface; pixels with fewer are edges or noise."""
MIN_CONDITION = 1e-3
"""Determinant over the squared trace below which neighbours are collinear."""
MIN_COSINE = 0.1
"""Least cosine of the viewing angle; flatter surfaces are left out."""

Float = NDArray[np.float32]


def fit_planes(depth: Float, rays: Float) -> tuple[Float, Float]:
    """Fit a plane to each pixel; return refined depth and normals.

    Parameters
    ----------
    depth : (H, W) float32
        Metres along +Z, 0 where there is none.
    rays : (H, W, 3) float32
        As from `Pinhole.rays`.

    Returns
    -------
    depth : (H, W) float32
        Depth of the fitted planes; 0 where the fit failed.
    normal : (H, W, 3) float32
        Unit vectors towards the camera; 0 where the fit failed.
    """
    step = max(1, round(depth.shape[1] / COLUMNS))
    offsets = range(-REACH * step, REACH * step + 1, step)
    reach = REACH * step
    near = np.minimum(SAME_SURFACE_M, SAME_SURFACE * depth)
    point = rays * depth[..., None]
    padded_depth = np.pad(depth, reach)
    padded = np.pad(point, ((reach, reach), (reach, reach), (0, 0)))
    height, width = depth.shape
    count = np.zeros(depth.shape, np.float32)
    first = np.zeros((*depth.shape, 3), np.float32)
    second = np.zeros((*depth.shape, 3, 3), np.float32)
    for dy in offsets:
        for dx in offsets:
            at = np.s_[reach + dy : reach + dy + height, reach + dx : reach + dx + width]
            same = ((np.abs(padded_depth[at] - depth) < near) & (depth > 0.0)).astype(np.float32)
            count += same
            # Coordinates relative to the pixel's own point keep the precision of sums of squares.
            d = (padded[at] - point) * same[..., None]
            first += d
            second += d[..., None] * d[..., None, :]
    count = np.maximum(count, 1.0)
    mean = first / count[..., None]
    spread = second / count[..., None, None] - mean[..., None] * mean[..., None, :]
    # Row i of the cofactors solves the least squares for coordinate i, and its diagonal element is
    # the determinant.
    cofactors = np.cross(np.roll(spread, -1, axis=-2), np.roll(spread, -2, axis=-2))
    determinants = np.diagonal(cofactors, axis1=-2, axis2=-1)
    best = np.argmax(determinants, axis=-1)[..., None, None]
    normal = np.take_along_axis(cofactors, best, axis=-2)[..., 0, :]
    trace = np.trace(spread, axis1=-2, axis2=-1)
    condition = determinants.max(axis=-1) / np.maximum(trace**2, 1e-30)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = normal / np.maximum(length, 1e-30)
    towards = (normal * rays).sum(axis=-1)
    normal = np.where(towards[..., None] > 0.0, -normal, normal)
    flat = np.abs(towards) / np.linalg.norm(rays, axis=-1)
    enough = MIN_SHARE * len(offsets) ** 2
    good = (count >= enough) & (condition > MIN_CONDITION) & (flat > MIN_COSINE)
    on_plane = ((point + mean) * normal).sum(axis=-1)
    refined = on_plane / np.where(good, -np.abs(towards), 1.0)
    good &= np.abs(refined - depth) < near
    return (
        np.where(good, refined, 0.0).astype(np.float32),
        np.where(good[..., None], normal, 0.0).astype(np.float32),
    )
