"""Disk cache for the trees of large meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.bvh.build import mesh_tree
from iprt.bvh.tree import Tree
from iprt.device.kept import kept

Floats = NDArray[np.float32]

WORTH_KEEPING = 1000
"""Triangle count from which reading a tree is faster than building it."""


def cached_tree(low: Floats, high: Floats) -> Tree:
    """Return `mesh_tree` of these boxes, from the cache (`iprt.device.kept`) if possible."""
    if len(low) < WORTH_KEEPING:
        return mesh_tree(low, high)
    return Tree(**kept("tree", "iprt.bvh.build", [low, high], lambda: vars(mesh_tree(low, high))))
