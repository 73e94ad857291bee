"""What lies behind the windows of a panorama, as a distant environment."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

OUTSIDE_ROWS = 128
"""Rows of the environment: enough for directions that no window showed to the camera."""

Image = NDArray[np.float64]


def outside_radiance(color: NDArray[np.float32], opening: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Environment of all openings, extrapolated smoothly to where none was seen.

    Directions that openings cover keep their mean radiance; the others are filled by push-pull:
    averages over ever larger cells, weighted by how much of them openings cover.

    Parameters
    ----------
    color : (H, W, 3) float32
        Linear radiance of the panorama.
    opening : (H, W) bool
        `Frame.opening`; at least one True.

    Returns
    -------
    (OUTSIDE_ROWS, 2 OUTSIDE_ROWS, 3) float32
        Equirect, in the panorama's convention.
    """
    height, width = opening.shape
    sine = np.sin((np.arange(height) + 0.5) / height * np.pi)[:, None]
    weight = np.where(opening, sine, 0.0)
    rows = np.arange(height) * OUTSIDE_ROWS // height
    columns = np.arange(width) * 2 * OUTSIDE_ROWS // width
    cell = (rows[:, None] * 2 * OUTSIDE_ROWS + columns)[opening]
    size = 2 * OUTSIDE_ROWS**2
    light = weight[opening][:, None] * color[opening]
    shape = (OUTSIDE_ROWS, 2 * OUTSIDE_ROWS)
    total = np.bincount(cell, weight[opening], size).astype(np.float64).reshape(shape)
    sums = np.stack(
        [np.bincount(cell, light[:, c], size).astype(np.float64).reshape(shape) for c in range(3)],
        axis=-1,
    )
    return _push_pull(sums, total).astype(np.float32)


def _push_pull(sums: Image, weight: Image) -> Image:
    """Means `sums / weight`, (H, W, 3) and (H, W), filled from coarser levels where uncovered."""
    mean = sums / np.maximum(weight, 1e-300)[..., None]
    if weight.shape[0] == 1:
        return np.broadcast_to(sums.sum((0, 1)) / weight.sum(), mean.shape).copy()
    coarse = _push_pull(_halved(sums), _halved(weight[..., None])[..., 0])
    filled = coarse.repeat(2, axis=0).repeat(2, axis=1)
    # A tent over the repeated cells makes them linear between their centres, around the seam.
    smooth = ndimage.convolve1d(filled, (0.25, 0.5, 0.25), axis=1, mode="wrap")
    filled = ndimage.convolve1d(smooth, (0.25, 0.5, 0.25), axis=0, mode="nearest")
    return np.where(weight[..., None] > 0.0, mean, filled)


def _halved(image: Image) -> Image:
    """Sums over 2 x 2 cells of an image (H, W, C) with even sides."""
    height, width, channels = image.shape
    halved: Image = image.reshape(height // 2, 2, width // 2, 2, channels).sum((1, 3))
    return halved
