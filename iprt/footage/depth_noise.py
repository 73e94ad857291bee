"""Noise of depth, which sets how far the texels of one plane may lie from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.median import median_of_smallest

Picture = NDArray[np.float32]

GAP_TOLERANCE = (3e-4, 0.05)
"""Largest distance from the local plane within a window, relative to depth: for clean depth, where
a tight bound keeps windows from reaching around edges, and for the noisiest."""
_NOISE_FACTOR = 4.0
_NOISE_ROWS = 64
NEAREST = np.float32(1e30)
"""Largest inverse depth. It keeps products finite, because infinity times 0 is NaN."""


def fit_tolerance(depth: Picture) -> float:
    """Return the largest distance from the local plane in a window, relative to depth (H, W)."""
    departure, surfaces = plane_departure(depth, len(depth))
    count = int(surfaces.sum())
    return tolerance_of(median_of_smallest(departure, count) if count else 0.0)


def tolerance_of(departure: float) -> float:
    """Return `fit_tolerance` from the median of `plane_departure`."""
    return float(np.clip(_NOISE_FACTOR * departure, *GAP_TOLERANCE))


def plane_departure(depth: Picture, height: int) -> tuple[Picture, NDArray[np.intp]]:
    """Return deviations of inverse depth from a plane over three rows, relative to it.

    Along a meridian, a plane's inverse depth is a cosine of the angle. The sum of a texel's two
    neighbours is then exactly 2 cos(step) times its own value.

    Parameters
    ----------
    depth : (N, W) float32
        Adjacent rows of a panorama.
    height : int
        Number of the panorama's rows.

    Returns
    -------
    departure : (N - 2, W) float32
        Of the rows between the first and the last; infinite in open sky.
    surfaces : (N - 2,) int
        Number of texels of each row that are not open sky.
    """
    twice = np.float32(2.0 * np.cos(np.pi / height))
    departure = np.empty((max(len(depth) - 2, 0), depth.shape[1]), np.float32)
    surfaces = np.zeros(len(departure), np.intp)
    for first in range(0, len(departure), _NOISE_ROWS):
        block = slice(first, min(first + _NOISE_ROWS, len(departure)))
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.minimum(np.float32(1.0) / depth[first : block.stop + 2], NEAREST)
            middle = inverse[1:-1]
            bend = np.abs(inverse[:-2] + inverse[2:] - twice * middle)
            np.divide(bend, middle, out=departure[block])
        # Open sky is no surface, and is sorted behind all surfaces.
        empty = middle == 0.0
        departure[block][empty] = np.inf
        surfaces[block] = depth.shape[1] - np.count_nonzero(empty, axis=1)
    return departure, surfaces
