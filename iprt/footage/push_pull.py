"""Interpolation of scattered data on a panorama by push-pull.

After Marroquim et al. (2007), as *Natural Environment Illumination* fills its pictures: means over
larger and larger cells fill gaps in the smaller ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float64]


def push_pull(sums: Image, weight: Image, *, wide_levels: int = 0, blended: bool = False) -> Image:
    """Return means (H, W, C), filled from larger cells where little is known, across the seam.

    Parameters
    ----------
    sums : (H, W, C) float64
        Weighted sums of values; 0 where nothing is known.
    weight : (H, W) float64
    wide_levels : int
        Number of levels in which cells grow in width only.
    blended : bool
        Whether to blend means by their weights, in [0, 1], with larger cells. If not, any positive
        weight suffices.

    Returns
    -------
    (H, W, C) float64
        0 where nothing is known.
    """
    return _filled(sums, weight[..., None], wide_levels, 1.0 if blended else 0.0)


def _filled(sums: Image, weight: Image, wide_levels: int, full: float) -> Image:
    """Fill one level recursively; `full` is the weight above which a mean counts alone."""
    mean = sums / np.maximum(weight, 1e-300)
    if weight.size == 1:
        return mean
    axes = [axis for axis in (0, 1) if weight.shape[axis] > 1 and (axis or wide_levels <= 0)]
    larger_sums, larger_weight = sums, weight
    for axis in axes:
        larger_sums, larger_weight = _halved(larger_sums, axis), _halved(larger_weight, axis)
    filled = _filled(larger_sums, larger_weight, wide_levels - 1, full * 2 ** len(axes))
    for axis in axes:
        filled = _doubled(filled, axis, weight.shape[axis])
    if not full:
        return np.where(weight > 0.0, mean, filled)
    share = np.minimum(weight / full, 1.0)
    return np.asarray(share * mean + (1.0 - share) * filled)


def _halved(image: Image, axis: int) -> Image:
    """Return sums over pairs of cells along an axis.

    An odd number of cells is padded with the first column (across the seam), or the last row.
    """
    if image.shape[axis] % 2:
        beyond = image[:, :1] if axis else image[-1:]
        image = np.concatenate([image, beyond], axis=axis)
    return np.asarray(image[:, 0::2] + image[:, 1::2] if axis else image[0::2] + image[1::2])


def _doubled(image: Image, axis: int, size: int) -> Image:
    """Upsample to `size` cells along an axis, linearly between the centres of the old ones.

    Axis 1 wraps around the seam.
    """
    count = image.shape[axis]
    near, far = 0.75 * image, 0.25 * image
    doubled = np.empty((*image.shape[:axis], 2 * count, *image.shape[axis + 1 :]))
    # Views whose first axis is the one along which cells are doubled.
    twice, near, far = (np.moveaxis(part, axis, 0) for part in (doubled, near, far))
    first, last = (far[-1], far[0]) if axis else (far[0], far[-1])
    np.add(far[:-1], near[1:], out=twice[2::2])
    np.add(near[:-1], far[1:], out=twice[1:-1:2])
    twice[0], twice[-1] = first + near[0], near[-1] + last
    return np.asarray(doubled[:, :size] if axis else doubled[:size])
