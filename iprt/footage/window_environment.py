"""Distant environment behind the windows of a panorama."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.device.kernel_source import constant
from iprt.footage.cells import binned
from iprt.footage.push_pull import push_pull
from iprt.geometry.equirect import texel_polar_angles

OUTSIDE_ROWS = constant("lib/world/real/panorama.h", "OUTSIDE_ROWS")
"""Rows of the environment; directions that no window shows need no more."""

WIDE_LEVELS = 4
"""Number of push-pull levels in which cells grow in width only."""


def outside_radiance(
    light: NDArray[np.floating], opening: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Extrapolate the environment seen through openings to all directions.

    Directions covered by openings keep their mean radiance. Push-pull fills the others: it averages
    over larger and larger cells, weighted by their coverage. Cells are up to 16 times as wide as
    high, because skies and grounds vary with elevation more than with azimuth.

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
    both = binned(weight[:, None] * np.c_[light, np.ones(len(light))], cell, 2 * OUTSIDE_ROWS**2)
    both = both.reshape(OUTSIDE_ROWS, 2 * OUTSIDE_ROWS, 4)
    filled = push_pull(both[..., :3], both[..., 3], wide_levels=WIDE_LEVELS)
    return filled.astype(np.float32)
