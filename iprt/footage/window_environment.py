"""The distant environment behind the windows of a panorama."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.equirect import texel_polar_angles

OUTSIDE_ROWS = 128
"""Rows of the environment: enough for directions that no window showed to the camera."""

WIDE_LEVELS = 4
"""Levels of push-pull in which cells grow in width only."""

Image = NDArray[np.float64]


def outside_radiance(
    light: NDArray[np.floating], opening: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Environment of all openings, extrapolated smoothly to where none was seen.

    Directions that openings cover keep their mean radiance; the others are filled by push-pull:
    averages over ever larger cells, weighted by how much of them openings cover. Cells are up to
    16 times as wide as high: skies and grounds change with elevation more than with azimuth.

    Parameters
    ----------
    light : (N, 3) float
        Linear radiance of the texels of all openings, row by row.
    opening : (H, W) bool
        `Frame.opening`; N of them are True, at least one.

    Returns
    -------
    (OUTSIDE_ROWS, 2 OUTSIDE_ROWS, 3) float32
        Equirect, in the panorama's convention.
    """
    height, width = opening.shape
    texel = np.flatnonzero(opening)
    row, column = texel // width, texel % width
    weight = np.sin(texel_polar_angles(height))[row]
    cell = row * OUTSIDE_ROWS // height * 2 * OUTSIDE_ROWS + column * 2 * OUTSIDE_ROWS // width
    size = 2 * OUTSIDE_ROWS**2
    weighted = weight[:, None] * light
    shape = (OUTSIDE_ROWS, 2 * OUTSIDE_ROWS)
    total = np.bincount(cell, weight, size).astype(np.float64).reshape(shape)
    sums = np.stack(
        [
            np.bincount(cell, weighted[:, c], size).astype(np.float64).reshape(shape)
            for c in range(3)
        ],
        axis=-1,
    )
    return _filled(sums, total[..., None]).astype(np.float32)


def _filled(sums: Image, weight: Image, level: int = 0) -> Image:
    """Means `sums / weight`, (H, W, 3) and (H, W, 1), where uncovered those of coarser levels."""
    mean = sums / np.maximum(weight, 1e-300)
    if weight.size == 1:
        return mean
    axes = [axis for axis in (0, 1) if weight.shape[axis] > 1 and (axis or level >= WIDE_LEVELS)]
    wide_sums, wide_weight = sums, weight
    for axis in axes:
        wide_sums, wide_weight = _halved(wide_sums, axis), _halved(wide_weight, axis)
    filled = _filled(wide_sums, wide_weight, level + 1)
    for axis in axes:
        filled = _doubled(filled, axis)
    return np.where(weight > 0.0, mean, filled)


def _doubled(image: Image, axis: int) -> Image:
    """Twice as many cells along an axis, linear between the centres of the old ones.

    Along axis 1 around the seam.
    """
    cells = np.moveaxis(image, axis, 0)
    before, after = np.roll(cells, 1, 0), np.roll(cells, -1, 0)
    if axis == 0:
        before[0], after[-1] = cells[0], cells[-1]
    doubled = np.empty((2 * len(cells), *cells.shape[1:]))
    doubled[0::2] = 0.25 * before + 0.75 * cells
    doubled[1::2] = 0.75 * cells + 0.25 * after
    return np.moveaxis(doubled, 0, axis)


def _halved(image: Image, axis: int) -> Image:
    """Sums over pairs of cells along an axis of even length."""
    shape = (*image.shape[:axis], image.shape[axis] // 2, 2, *image.shape[axis + 1 :])
    return np.asarray(image.reshape(shape).sum(axis + 1))
