"""Rays from surfaces of a panorama towards a distant light."""

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
    """Return whether rays leave the room, through an opening or to open sky.

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
    (n,) bool
    """
    depth, is_open = cells.depth.astype(np.float32), (cells.opening + cells.sky) > 0.5
    outdoors = is_outdoors(cells.sky.reshape(cells.rows, -1))
    found = [
        _leave(cells.rows, depth, is_open, outdoors, start[at:end], direction[at:end], steps)
        for at in range(0, len(start), AT_ONCE)
        for end in (at + AT_ONCE,)
    ]
    return np.concatenate(found) if found else np.zeros(0, bool)


def _leave(
    rows: int,
    depth: NDArray[np.float32],
    is_open: NDArray[np.bool_],
    outdoors: bool,
    start: Float,
    direction: Float,
    steps: int,
) -> NDArray[np.bool_]:
    arcs = RayArcs(start, direction)
    # The last point is a little before the direction itself, which is infinitely far away.
    part = np.arange(1, steps + 1, dtype=np.float32)[:, None] / np.float32(steps + 0.01)
    deep, cell = arcs.behind(part * arcs.whole, depth, rows)
    through = is_open[cell]
    before = np.concatenate([np.full((1, len(start)), -1.0, np.float32), deep[:-1]])
    crosses = (deep > CLEARANCE) & (before <= CLEARANCE)
    far = depth[cell]
    connected = np.abs(np.diff(far, axis=0, prepend=far[:1])) < CONNECTED * far
    ends = crosses & (through | connected | (deep < THICKNESS))
    # Open sky is crossed by no ray.
    last, there = ends.argmax(axis=0), np.arange(len(start))
    beyond = np.where(deep[-1] > CLEARANCE, outdoors, through[-1])
    return np.asarray(np.where(ends.any(axis=0), through[last, there], beyond))
