"""Rays through a panorama in cells, followed on the host."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cells import Cells, Float
from iprt.footage.ray_arcs import RayArcs
from iprt.footage.sun import is_outdoors

CLEARANCE, THICKNESS = 0.01, 0.2
"""Bounds relative to depth: a ray that gets deeper below a surface than the clearance is blocked.
One that is deeper than the thickness at once passes behind the surface."""
CONNECTED = 0.1
"""Relative difference in depth up to which points of a ray are seen before one surface: it cannot
pass behind it between them."""
AT_ONCE = 1 << 11
"""Rays whose points fit into a processor's cache."""


def leaves(cells: Cells, start: Float, direction: Float, steps: int) -> NDArray[np.bool_]:
    """Return (n,) whether rays leave the room; see `ends`."""
    return ends(cells, start, direction, steps)[0]


def ends(
    cells: Cells, start: Float, direction: Float, steps: int
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Return whether rays leave the room, through an opening or to open sky, and where they end.

    A ray leaves through an opening where it crosses the depth of the opening's rim. One that ends
    behind a surface has left if it is outdoors, as behind a house.

    Parameters
    ----------
    cells : Cells
        Surfaces that block rays.
    start : (n, 3) float64
        Origins in metres, slightly off their surface.
    direction : (n, 3) float64
        Unit vectors.
    steps : int
        Points at which a ray is tested, evenly spaced in angle about the capture centre.

    Returns
    -------
    (n,) bool, (n,) int
        The cell is the one that blocks a ray or that it leaves through, else the one in its
        direction.
    """
    depth, is_open = cells.depth.astype(np.float32), (cells.opening + cells.sky) > 0.5
    outdoors = is_outdoors(cells.sky.reshape(cells.rows, -1))
    left, cell = np.zeros(len(start), bool), np.zeros(len(start), np.intp)
    for at in range(0, len(start), AT_ONCE):
        one = slice(at, at + AT_ONCE)
        arcs = RayArcs(start[one], direction[one])
        left[one], cell[one] = _ends(cells.rows, depth, is_open, outdoors, arcs, steps)
    return left, cell


def _ends(
    rows: int,
    depth: NDArray[np.float32],
    is_open: NDArray[np.bool_],
    outdoors: bool,
    arcs: RayArcs,
    steps: int,
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    # The last point is a little before the direction itself, which is infinitely far away.
    part = np.arange(1, steps + 1, dtype=np.float32)[:, None] / np.float32(steps + 0.01)
    deep, cell = arcs.behind(part * arcs.whole, depth, rows)
    through = is_open[cell]
    there = np.arange(deep.shape[1])
    before = np.concatenate([np.full((1, len(there)), -1.0, np.float32), deep[:-1]])
    crosses = (deep > CLEARANCE) & (before <= CLEARANCE)
    far = depth[cell]
    connected = np.abs(np.diff(far, axis=0, prepend=far[:1])) < CONNECTED * far
    blocked = crosses & (through | connected | (deep < THICKNESS))
    # Open sky is crossed by no ray.
    is_blocked = blocked.any(axis=0)
    last = np.where(is_blocked, blocked.argmax(axis=0), steps - 1)
    beyond = np.where(deep[-1] > CLEARANCE, outdoors, through[-1])
    return np.where(is_blocked, through[last, there], beyond), cell[last, there]
