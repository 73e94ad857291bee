"""Distant environment behind the windows of a panorama."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cells import Float, binned, cell_texels
from iprt.footage.push_pull import push_pull
from iprt.footage.sky import OUTSIDE_ROWS, Sky
from iprt.geometry.equirect import texel_polar_angles

WIDE_LEVELS = 4
"""Number of push-pull levels in which cells grow in width only."""


def outside_radiance(
    light: NDArray[np.floating], opening: NDArray[np.bool_], sky: Sky | None = None
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
    sky : Sky or None
        Factors for directions that openings do not cover, in the axes of the panorama.

    Returns
    -------
    (OUTSIDE_ROWS, 2 OUTSIDE_ROWS, 3) float32
        Equirect, in the panorama's convention.
    """
    texel, cell = _cells_of(opening)
    weight = np.sin(texel_polar_angles(len(opening)))[texel // opening.shape[1]]
    both = binned(weight[:, None] * np.c_[light, np.ones(len(light))], cell, 2 * OUTSIDE_ROWS**2)
    both = both.reshape(OUTSIDE_ROWS, 2 * OUTSIDE_ROWS, 4)
    filled = push_pull(both[..., :3], both[..., 3], wide_levels=WIDE_LEVELS)
    if sky is not None:
        seen = seen_share(opening)[..., None]
        filled *= seen + (1.0 - seen) * sky.factors
    return filled.astype(np.float32)


def seen_share(opening: NDArray[np.bool_]) -> Float:
    """Return the share (OUTSIDE_ROWS, 2 OUTSIDE_ROWS) of the environment that openings show."""
    _, cell = _cells_of(opening)
    texels = np.maximum(cell_texels(opening.shape, OUTSIDE_ROWS), 1)
    count = np.bincount(cell, minlength=texels.size).reshape(texels.shape)
    return np.asarray(count / texels)


def _cells_of(opening: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices (N,) of texels in openings, and of their texels of the environment."""
    height, width = opening.shape
    texel = np.flatnonzero(opening)
    row, column = texel // width, texel % width
    cell = row * OUTSIDE_ROWS // height * 2 * OUTSIDE_ROWS + column * 2 * OUTSIDE_ROWS // width
    return texel, cell
