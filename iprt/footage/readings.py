"""Detection of the quantity that depth files store, by the planes of the place.

Files store the distance along the ray, its inverse, or its component along the axis of a cube's
face or along a single axis. Only the correct reading makes floors, walls and ceilings flat; others
bend them. Each reading is therefore scored by the share of the sphere that a few planes explain.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.video.depth_code import usable
from iprt.geometry.equirect import equirect_direction

Float = NDArray[np.float64]
Mask = NDArray[np.bool_]
Reading = Literal["distance", "inverse", "cube", "axis", "twice"]
"""Quantity that depth stores. "cube": component along the axes of a cube's faces; "axis": along one
axis; "twice": distances that were converted as if they were "cube"."""

ROWS = 64
"""Least number of rows of sampled directions."""
PLANES = 4
"""Number of planes that explain a place: a floor, a ceiling, walls."""
CANDIDATES = 300
REACH = 3
"""Half width, in sampled directions, of the window to which a candidate is fitted."""
FLAT = 0.02
"""Tolerance of points on a plane, relative to their distance from the camera."""
LEAST_SHARE, LEAST_FACTOR = 0.2, 1.8
"""Least share of the directions that planes explain by another reading than distance, and its least
ratio to the share by distance, for that reading to be chosen. Rooms have 0.7 to 0.8 by the correct
reading and 0.1 to 0.15 by a wrong one. Depth estimated by a network has 0.25, and 0.14."""
LEAST_ALONG = 0.1
"""Least component of a direction along an axis for which depth along the axis is meaningful."""
BEYOND_FACE = 0.1
"""Least share of the explained directions that lie beyond their plane's main cube face. Real planes
extend over several faces; a dome read as a cube has a plane in each."""
BESIDE, LESS = 0.2, 0.5
"""Component of a direction along an axis below which depth along the axis is small, and its limit
there, relative to the median. Where it is larger, apparent planes on both sides are a dome."""


def likely_reading(depth: NDArray[np.float32], *, is_cube: bool = False) -> Reading:
    """Return the most likely reading of depth (H, W).

    Parameters
    ----------
    depth : (H, W) float32
        As read, not turned: the middle of the picture is the middle of a cube's face.
    is_cube : bool
        True if it has been converted from the depth of a cube's faces.
    """
    height, width = depth.shape
    step = max(1, height // ROWS)
    row, column, direction = sparse_texels(width, height, step)
    chosen = depth[row, column]
    stored = np.where(usable(chosen), chosen, np.float32(0.0)).astype(np.float64)
    part, ahead = np.abs(direction).max(axis=-1), np.abs(direction[..., 2])
    shares: dict[Reading, float] = {}
    with np.errstate(all="ignore"):
        distances: dict[Reading, Float] = {
            "distance": stored,
            "inverse": 1.0 / stored,
            "cube": stored / part,
            "axis": stored / np.where(_falls_beside(stored, ahead), ahead, np.nan),
            "twice": stored * part if is_cube else np.zeros_like(stored),
        }
        # All readings use the same directions, so that shares can be compared.
        there = stored > 0.0
        for reading, distance in distances.items():
            shares[reading], beyond = _explained(direction, distance, there)
            if reading == "cube" and beyond < BEYOND_FACE:
                shares[reading] = 0.0
    best = max(shares, key=lambda reading: shares[reading])
    is_clear = shares[best] > max(LEAST_SHARE, LEAST_FACTOR * shares["distance"])
    return best if is_clear else "distance"


def sparse_texels(
    width: int, height: int, step: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], Float]:
    """Return rows, columns (h, w) and directions (h, w, 3) of every `step`-th texel."""
    row, column = np.meshgrid(
        np.arange(step // 2, height, step), np.arange(step // 2, width, step), indexing="ij"
    )
    pixels = np.asarray(np.stack([column, row], axis=-1) + 0.5, np.float64)
    return row, column, equirect_direction(pixels, width, height)


def _falls_beside(stored: Float, ahead: Float) -> Mask:
    """Return a mask of directions with depth along an axis; empty if depth beside it is not small.

    Parameters
    ----------
    stored, ahead : (h, w) float64
        Depth, 0 where there is none, and each direction's component along the axis.
    """
    there = stored > 0.0
    beside = there & (ahead < BESIDE)
    small = beside.any() and np.median(stored[beside]) < LESS * np.median(stored[there])
    return (ahead > LEAST_ALONG) & bool(small)


def _explained(direction: Float, distance: Float, there: Mask) -> tuple[float, float]:
    """Score a reading by the directions that a few planes explain.

    Parameters
    ----------
    direction : (h, w, 3) float64
    distance : (h, w) float64
        Distance along each direction, according to the reading.
    there : (h, w) bool
        Directions that count.

    Returns
    -------
    explained : float
        Explained share of the directions that count.
    beyond : float
        Share of these that lies beyond the cube face with most of their plane.
    """
    known = there & np.isfinite(distance) & (distance > 0.0)
    if np.count_nonzero(known[REACH:-REACH]) < CANDIDATES:
        return 0.0, 0.0
    inverse = np.zeros_like(distance)
    np.divide(1.0, distance, out=inverse, where=known)
    sine = np.sqrt(1.0 - direction[..., 1] ** 2)
    planes = _candidates(direction, inverse, known, sine)
    weight, of_texel = sine[known], inverse[known]
    on_plane = np.abs(direction[known] @ planes.T - of_texel[:, None]) <= FLAT * of_texel[:, None]
    axis = np.abs(direction[known]).argmax(axis=1)
    face = 2 * axis + (np.take_along_axis(direction[known], axis[:, None], 1)[:, 0] < 0.0)
    total = sine[there].sum()
    explained = in_faces = 1e-12
    for _ in range(PLANES):
        on_best = on_plane[:, int((weight @ on_plane).argmax())]
        explained += float(weight @ on_best)
        in_faces += float(np.bincount(face, weight * on_best).max())
        weight = np.where(on_best, 0.0, weight)
    return explained / float(total), 1.0 - in_faces / explained


def _candidates(direction: Float, inverse: Float, known: Mask, weight: Float) -> Float:
    """Return planes (N, 3) fitted to windows around directions spread evenly over the sphere.

    A plane `g . p = 1` is linear in inverse depth, `1 / r = g . w`.
    """
    products = direction[..., :, None] * direction[..., None, :] * known[..., None, None]
    matrix, right = _windows(products), _windows(direction * inverse[..., None])
    here = (weight * known)[REACH:-REACH].ravel()
    upto = np.cumsum(here)
    chosen = np.searchsorted(upto, (np.arange(CANDIDATES) + 0.5) / CANDIDATES * upto[-1])
    # Regularised for windows with too few directions.
    matrix = matrix.reshape(-1, 3, 3)[chosen] + 1e-9 * np.eye(3)
    return np.asarray(np.linalg.solve(matrix, right.reshape(-1, 3, 1)[chosen])[..., 0])


def _windows(plane: Float) -> Float:
    """Return sums (h - 2 REACH, w, ...) over windows that wrap around at the seam."""
    ones = np.ones(2 * REACH + 1)
    down = scipy.ndimage.convolve1d(plane, ones, axis=0)[REACH:-REACH]
    return np.asarray(scipy.ndimage.convolve1d(down, ones, axis=1, mode="wrap"))
