"""The distant environment behind the windows of a panorama."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.push_pull import push_pull
from iprt.geometry.equirect import texel_polar_angles

OUTSIDE_ROWS = 128
"""Rows of the environment: enough for directions that no window showed to the camera."""

WIDE_LEVELS = 4
"""Levels of push-pull in which cells grow in width only."""


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
    return push_pull(sums, total, wide_levels=WIDE_LEVELS).astype(np.float32)
