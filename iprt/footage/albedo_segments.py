"""Segmentation of a panorama's surfaces by reflectance, for points where light is compared."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.cells import Cells, Float

PARALLEL, BESIDE = 0.95, 0.03
"""Least cosine of normals, and largest distance from each other's plane relative to depth, of
neighbouring cells on one surface."""
HUE, STEP = 0.02, 0.2
"""Largest differences between neighbours of equal reflectance, in chromaticity and in log-radiance,
for cells of `STEP_ROWS`: light changes gradually, reflectance does not."""
STEP_ROWS = 128
MIN_POINTS = 4
"""Least number of points of a segment, to separate shading from reflectance."""
ROUGH, GRAZING = 0.1, 0.1
"""Largest `Cells.rough` and least cosine of view of cells with a well-known surface."""
LIFT = 0.02
"""Offset of points from their surface, relative to depth."""


def well_seen(cells: Cells) -> NDArray[np.bool_]:
    """Return (N,) whether cells show a piece of a single surface."""
    facing = np.abs((cells.normal * cells.direction).sum(-1))
    whole = (cells.opening == 0.0) & (cells.sky == 0.0)
    return np.asarray(whole & (cells.rough < ROUGH) & (facing > GRAZING))


def segments(cells: Cells, color: Float, usable: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Label segments: connected usable cells on one surface with equal reflectance.

    Parameters
    ----------
    cells : Cells
    color : (N, 3) float64
        Mean radiance, positive where usable.
    usable : (N,) bool
        Cells that may be connected.

    Returns
    -------
    (N,) int
        Index of each cell's segment.
    """
    rows, size = cells.rows, len(color)
    number = np.arange(size).reshape(rows, 2 * rows)
    pairs = [(number, np.roll(number, -1, axis=1)), (number[:-1], number[1:])]
    a = np.concatenate([first.ravel() for first, _ in pairs])
    b = np.concatenate([second.ravel() for _, second in pairs])
    hue = color / np.maximum(color.sum(-1, keepdims=True), 1e-30)
    bright = np.log(np.maximum(color.sum(-1), 1e-30))
    like = usable[a] & usable[b]
    like &= (cells.normal[a] * cells.normal[b]).sum(-1) > PARALLEL
    step = ((cells.point[b] - cells.point[a]) * cells.normal[a]).sum(-1)
    like &= np.abs(step) < BESIDE * cells.depth[a]
    like &= np.abs(hue[a] - hue[b]).max(-1) < HUE
    like &= np.abs(bright[a] - bright[b]) < STEP * max(1.0, STEP_ROWS / rows)
    links = scipy.sparse.coo_array((np.ones(like.sum()), (a[like], b[like])), shape=(size, size))
    return np.asarray(scipy.sparse.csgraph.connected_components(links, directed=False)[1], np.intp)


def spread_cells(rows: int, count: int) -> NDArray[np.intp]:
    """Return about `count` cells evenly spread over the sphere (Fibonacci spiral), ascending."""
    turn = np.arange(count) + 0.5
    row = np.arccos(1.0 - 2.0 * turn / count) / np.pi * rows
    column = turn * (1.0 + 5.0**0.5) / 2.0 % 1.0 * 2 * rows
    return np.unique(np.minimum(row.astype(np.intp), rows - 1) * 2 * rows + column.astype(np.intp))


def points_of_segments(
    segment: NDArray[np.intp], candidates: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the candidate cells of large enough segments, and their renumbered segments."""
    own = segment[candidates]
    enough = np.bincount(own, minlength=1)[own] >= MIN_POINTS
    _, renumbered = np.unique(own[enough], return_inverse=True)
    return candidates[enough], renumbered.astype(np.intp)


def lifted(cells: Cells, chosen: NDArray[np.intp]) -> Float:
    """Return points (n, 3) of chosen cells, slightly off their surfaces."""
    lift = LIFT * cells.depth[chosen, None]
    return np.asarray(cells.point[chosen] + lift * cells.normal[chosen])
