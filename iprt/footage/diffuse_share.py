"""Diffuse share of the radiance of glossy surfaces."""

from __future__ import annotations

import numpy as np

from iprt.footage.cells import Cells, Float, Geometry, cell_means
from iprt.footage.coat_reflection import LIFT, Patch, RoomCells, reflected
from iprt.footage.frame import Frame

ROWS, ROOM_ROWS = 64, 128
"""Rows of cells of glossy surfaces, and of their surroundings, in large enough frames."""
RAYS = 32
SAME_PLANE = 0.97
"""Least cosine of a cell's normal and the mean normal of its material's cells."""
LEAST = 0.1
"""Least diffuse share: reflections are not predicted better."""


def diffuse_share(frame: Frame, shown: Geometry) -> Float:
    """Return the share (r, 2 r, 3) of diffuse radiance in r rows of cells, at most `ROWS`.

    It is the share towards the capture centre: 1 but where the coat of a plastic reflects.
    """
    rows = min(ROWS, frame.height)
    share = np.ones((2 * rows**2, 3))
    if frame.gloss is not None:
        room = RoomCells.of(frame, shown, min(ROOM_ROWS, frame.height))
        cells = Cells.of(shown, rows)
        color = cell_means(frame.radiance, rows).reshape(-1, 3)
        for index, material in enumerate(frame.real_materials):
            covered = cell_means(frame.gloss == index + 1, rows).ravel()
            on = np.flatnonzero(covered > 0.5)
            if material.kind != "plastic" or not len(on):
                continue
            normal = cells.normal[on].mean(axis=0)
            normal /= np.linalg.norm(normal)
            on = on[cells.normal[on] @ normal > SAME_PLANE]
            start = cells.point[on] + LIFT * cells.depth[on, None] * normal
            patch = Patch(start, cells.direction[on], normal)
            coat = reflected(room, patch, material.alpha, seed=1, rays=RAYS).sum(axis=0)
            seen = np.maximum(color[on], 1e-30)
            share[on] = np.clip(1.0 - coat / seen, LEAST, 1.0)
    return share.reshape(rows, 2 * rows, 3)
