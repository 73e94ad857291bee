"""Detection of large planes in the cells of a panorama: floors, walls, table tops."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from iprt.footage.albedo_segments import well_seen
from iprt.footage.cells import Cells, Float

MAX_PLANES = 24
MIN_SHARE = 0.003
"""Least share of the sphere that a plane covers. A coffee table at two metres covers 0.012, what
is seen of a laid dinner table 0.008."""
PARALLEL = 0.95
"""Least cosine between a cell's normal and its plane's."""
GRAZING = 0.15
"""Least cosine of view of usable cells."""
NEAREST = 0.5
"""Depth, in metres, below which the tolerance of cells stops shrinking."""
TRIES, REFITS = 60, 3


@dataclass(frozen=True)
class CellPlane:
    """A plane and the cells on it.

    Attributes
    ----------
    normal : (3,) float64
        Unit normal, world space, towards the capture centre.
    offset : float
        normal · point, in metres.
    tolerance : float
        Largest distance of a cell from the plane, relative to its depth.
    cells : (n,) int
        Indices of cells, ascending.
    """

    normal: Float
    offset: float
    tolerance: float
    cells: NDArray[np.intp]


def find_planes(cells: Cells, tolerance: float, usable: NDArray[np.bool_]) -> list[CellPlane]:
    """Find the largest planes by solid angle, each at least `MIN_SHARE` of the sphere.

    Random cells propose their tangent planes, as in RANSAC. The plane with the largest solid angle
    is refitted to its cells by least squares, its cells are removed, and the search repeats.

    Parameters
    ----------
    cells : Cells
    tolerance : float
        Largest distance of a cell from its plane, relative to its depth.
    usable : (N,) bool
        Cells that may belong to a plane.
    """
    left = usable & _facing(cells)
    least = MIN_SHARE * 4.0 * np.pi
    reach = tolerance * np.maximum(cells.depth, NEAREST)
    rng = np.random.default_rng(0)
    found: list[CellPlane] = []
    while len(found) < MAX_PLANES and cells.solid_angle[left].sum() >= least:
        there = np.flatnonzero(left)
        weight = cells.solid_angle[there]
        on: NDArray[np.intp] = there[:0]
        for seed in rng.choice(there, TRIES, p=weight / weight.sum()):
            normal = cells.normal[seed]
            mine = _lying_on(cells, there, normal, float(cells.point[seed] @ normal), reach)
            if cells.solid_angle[mine].sum() > cells.solid_angle[on].sum():
                on = mine
        for _ in range(REFITS):
            if len(on) < 3:
                break
            normal, offset = _fitted(cells, on)
            on = _lying_on(cells, there, normal, offset, reach)
        if cells.solid_angle[on].sum() < least:
            break
        left[on] = False
        found.append(CellPlane(normal, offset, tolerance, on))
    return found


def on_finer_cells(plane: CellPlane, cells: Cells, usable: NDArray[np.bool_]) -> CellPlane:
    """Return a plane with its usable (N,) cells in another grid."""
    among = np.flatnonzero(usable & _facing(cells))
    reach = plane.tolerance * np.maximum(cells.depth, NEAREST)
    on = _lying_on(cells, among, plane.normal, plane.offset, reach)
    return replace(plane, cells=on)


def _facing(cells: Cells) -> NDArray[np.bool_]:
    facing = np.abs((cells.normal * cells.direction).sum(-1))
    return np.asarray(well_seen(cells) & (facing > GRAZING))


def _lying_on(
    cells: Cells, among: NDArray[np.intp], normal: Float, offset: float, reach: Float
) -> NDArray[np.intp]:
    along = cells.normal[among] @ normal > PARALLEL
    near = np.abs(cells.point[among] @ normal - offset) < reach[among]
    return np.asarray(among[along & near], np.intp)


def _fitted(cells: Cells, on: NDArray[np.intp]) -> tuple[Float, float]:
    """Fit a plane to cells, with less weight for far ones; return normal and offset."""
    point, weight = cells.point[on], 1.0 / cells.depth[on] ** 2
    mean = cells.normal[on].mean(0)
    spread = point - np.average(point, axis=0, weights=weight)
    _, axes = np.linalg.eigh(np.einsum("i,ij,ik->jk", weight, spread, spread))
    normal = axes[:, 0] * np.sign(axes[:, 0] @ mean)
    # A strip of cells leaves the rotation about it undetermined; their normals do not.
    if normal @ mean < PARALLEL * np.linalg.norm(mean):
        normal = mean / np.linalg.norm(mean)
    return normal, float(np.median(point @ normal))
