"""What depth measures, by the planes of the place: they are flat by one reading alone.

Distances along the rays, their inverse, and parts of them along the axes of a cube's faces or along
one axis are all written as depth. Floors, walls and ceilings are flat if it is read as what it is,
and bend otherwise. So each reading is given the share of all directions that few planes explain.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from iprt.footage.coarse_depth import usable
from iprt.geometry.camera import equirect_direction

Float = NDArray[np.float64]
Mask = NDArray[np.bool_]
Reading = Literal["distance", "inverse", "cube", "axis", "twice"]
""" "cube": along the axes of a cube's faces; "axis": along one; "twice": distances that have been
converted as if they were "cube"."""

ROWS = 64
"""Rows of directions that are looked at, at least."""
PLANES = 4
"""Planes that explain a place: a floor, a ceiling, walls."""
CANDIDATES = 300
REACH = 3
"""Directions to each side, among those looked at, that a candidate is fitted to."""
FLAT = 0.02
"""Distance of what lies on a plane from it, over the distance from the camera."""
LEAST_SHARE, LEAST_FACTOR = 0.2, 1.8
"""Share of the directions that planes explain by another reading than distance, and how many times
as many these are as by distance, where depth is taken to be that. Rooms have 0.7 to 0.8 by the
right reading and 0.1 to 0.15 by a wrong one; depth that a network estimated has 0.25, and 0.14."""
LEAST_ALONG = 0.1
"""Part of a direction along an axis below which depth along the axis tells nothing."""
BEYOND_FACE = 0.1
"""Share of what planes explain that lies beyond one face of a cube each, at least. Real planes know
no faces; a dome that is read as a cube has a plane in each."""
BESIDE, LESS = 0.2, 0.5
"""Part of a direction along an axis below which depth along the axis is small, and how small:
over the median. Where it is not, what looks like planes to both sides is a dome."""


def likely_reading(depth: NDArray[np.float32], *, is_cube: bool = False) -> Reading:
    """Return what depth (H, W) seems to measure.

    Parameters
    ----------
    depth : (H, W) float32
        As read, not turned: faces of a cube have the picture's middle in theirs.
    is_cube : bool
        Whether it has been converted from what a cube's faces measure.
    """
    height, width = depth.shape
    step = max(1, height // ROWS)
    row, column = np.meshgrid(
        np.arange(step // 2, height, step), np.arange(step // 2, width, step), indexing="ij"
    )
    chosen = depth[row, column]
    stored = np.where(usable(chosen), chosen, np.float32(0.0)).astype(np.float64)
    direction = equirect_direction(np.stack([column, row], axis=-1) + 0.5, width, height)
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
        # Of every reading, what is there by all of them, so that shares can be compared.
        there = stored > 0.0
        for reading, distance in distances.items():
            shares[reading], beyond = _explained(direction, distance, there)
            if reading == "cube" and beyond < BEYOND_FACE:
                shares[reading] = 0.0
    best = max(shares, key=lambda reading: shares[reading])
    is_clear = shares[best] > max(LEAST_SHARE, LEAST_FACTOR * shares["distance"])
    return best if is_clear else "distance"


def _falls_beside(stored: Float, ahead: Float) -> Mask:
    """Return which directions have depth along an axis; none where it is not small beside it.

    Parameters
    ----------
    stored, ahead : (h, w) float64
        Depth, 0 where there is none, and the part of each direction along the axis.
    """
    there = stored > 0.0
    beside = there & (ahead < BESIDE)
    small = beside.any() and np.median(stored[beside]) < LESS * np.median(stored[there])
    return (ahead > LEAST_ALONG) & bool(small)


def _explained(direction: Float, distance: Float, there: Mask) -> tuple[float, float]:
    """Return the share of directions (h, w, 3) whose distance (h, w) is that of few planes, and how
    much of that lies beyond the face of a cube that has most of its plane.

    Parameters
    ----------
    there : (h, w) bool
        Directions that count.
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
    """Return planes (N, 3) through windows around directions that lie evenly on the sphere.

    A plane `g . p = 1` is linear in inverse depth, `1 / r = g . w`.
    """
    products = direction[..., :, None] * direction[..., None, :] * known[..., None, None]
    matrix, right = _windows(products), _windows(direction * inverse[..., None])
    here = (weight * known)[REACH:-REACH].ravel()
    upto = np.cumsum(here)
    chosen = np.searchsorted(upto, (np.arange(CANDIDATES) + 0.5) / CANDIDATES * upto[-1])
    # A little on the diagonal, for windows of too few directions.
    matrix = matrix.reshape(-1, 3, 3)[chosen] + 1e-9 * np.eye(3)
    return np.asarray(np.linalg.solve(matrix, right.reshape(-1, 3, 1)[chosen])[..., 0])


def _windows(plane: Float) -> Float:
    """Return sums (h - 2 REACH, w, ...) over windows, which go on over the seam."""
    around = np.concatenate([plane[:, -REACH:], plane, plane[:, :REACH]], axis=1)
    rows, columns = plane.shape[0] - 2 * REACH, plane.shape[1]
    shifts = range(2 * REACH + 1)
    down = np.sum([around[shift : shift + rows] for shift in shifts], axis=0)
    return np.asarray(np.sum([down[:, shift : shift + columns] for shift in shifts], axis=0))
