"""Detection of cuts between two frames of a video.

Light alone does not indicate a cut: switching on a lamp changes more light than many cuts do. The
surfaces, and the positions of edges and textures, do.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.cells import cell_means
from iprt.footage.frame import LUMINANCE, Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_texel, solid_angles
from iprt.geometry.pose import camera_motion

Float = NDArray[np.float64]

ROWS = 32
"""Number of rows of the coarse panoramas that are compared."""
OTHER_DEPTH = 0.15
"""Relative difference of distances above which a surface is a different one."""
OTHER_SURFACES = 0.35
"""Share of the sphere with different surfaces above which there is a cut."""
SWITCHED = 0.5
"""Relative change of flux above which accumulated samples are outdated, even without a cut."""
OTHER_LIGHT, OTHER_DETAIL = 0.2, 0.3
"""Least relative change of flux, and largest correlation of details, at another kind of cut."""


def is_cut(before: Frame, after: Frame, flux_change: float) -> bool:
    """Return whether there is a cut between consecutive frames.

    Parameters
    ----------
    before, after : Frame
        Both of the same size. With poses, they are compared at the same points in the world.
    flux_change : float
        Relative difference of the panoramas' flux, in [0, 1].
    """
    if before is after:
        return False
    rows = min(ROWS, after.height, after.width // 2)
    view = View(2 * rows, rows, projection="equirect")
    weights = np.broadcast_to(solid_angles(2 * rows, rows)[:, None], (rows, 2 * rows))
    now = _sampled(after.depth, view.directions())
    motion = camera_motion(before.pose, after.pose)
    near = np.where(np.isfinite(now), now, 1e6)[..., None] * view.directions()
    seen = near @ motion[:, :3].T + motion[:, 3]
    expected = np.where(np.isfinite(now), np.linalg.norm(seen, axis=-1), np.inf)
    if _other_surfaces(_sampled(before.depth, seen), expected, weights) > OTHER_SURFACES:
        return True
    if flux_change <= OTHER_LIGHT:
        return False
    details = [_details(frame.picture, rows) for frame in (before, after)]
    return _correlation(_sampled(details[0], seen), details[1], weights) < OTHER_DETAIL


def _sampled(image: NDArray[np.floating], directions: Float) -> Float:
    """Return the nearest texels of an equirect image (H, W) in directions (..., 3)."""
    return np.asarray(image[equirect_texel(directions, *image.shape[::-1])], np.float64)


def _other_surfaces(found: Float, expected: Float, weights: Float) -> float:
    """Return the share of directions with an unexpected distance, up to a common factor.

    The scale of estimated depth wavers, hence the factor.
    """
    both = np.isfinite(found) & np.isfinite(expected)
    step = np.log(np.where(both, found, 1.0) / np.where(both, expected, 1.0))
    if both.any():
        step = step - np.median(step[both])
    other = np.where(both, np.abs(step) > OTHER_DEPTH, np.isfinite(found) != np.isfinite(expected))
    return float((other * weights).sum() / weights.sum())


def _details(color: NDArray[np.float32], rows: int) -> Float:
    """Return log-luminance (rows, 2 rows) minus its local mean."""
    light = cell_means(color, rows) @ LUMINANCE
    level = np.log(np.maximum(light, 1e-3 * light.mean() + 1e-30))
    return np.asarray(level - scipy.ndimage.uniform_filter(level, 3, mode=("nearest", "wrap")))


def _correlation(a: Float, b: Float, weights: Float) -> float:
    """Return the clipped correlation of two images; 1 if one has no details."""
    a, b = np.clip(a, -0.5, 0.5), np.clip(b, -0.5, 0.5)
    power = (weights * a * a).sum() * (weights * b * b).sum()
    return float((weights * a * b).sum() / np.sqrt(power)) if power > 1e-6 else 1.0
