"""A tree of emitting triangles, from which rays choose by power and distance.

A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting",
High Performance Graphics 2018, without their bounds of orientation: triangles emit on both sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

TREE_FROM = 1000
"""Number of emitting triangles above which they have a tree."""


@dataclass(frozen=True)
class LampTree:
    """A complete binary tree.

    Attributes
    ----------
    levels : int
        Depth of the leaves; the root has 0.
    nodes : (2 ** (levels + 1), 2, 4) float32
        Centre of the box and power; squared half of its diagonal, int bits of a leaf's triangle,
        0, 0. Node 1 is the root, nodes 2 i and 2 i + 1 are the children of node i.
    leaf_of : (count,) int32
        Leaf of each triangle.
    """

    levels: int
    nodes: NDArray[np.float32]
    leaf_of: NDArray[np.int32]


def tree_levels(count: int) -> int:
    """Return `LampTree.levels` for a number of triangles."""
    return max(count - 1, 0).bit_length()


def lamp_tree(corners: NDArray[np.float64], power: NDArray[np.float64]) -> LampTree:
    """Return the tree of triangles.

    Parameters
    ----------
    corners : (count, 3, 3)
        World space; count is at least 1.
    power : (count,)
        Area times mean emission.
    """
    count, levels = len(power), tree_levels(len(power))
    slots = 1 << levels
    middle = corners.mean(axis=1)
    order = np.arange(count)
    # Each node's triangles are split in halves along the longest side of their centres' box.
    for level in range(levels):
        node = np.arange(count) * (1 << level) // count
        starts = np.searchsorted(node, np.arange(1 << level))
        starts = np.minimum(starts, count - 1)
        low = np.minimum.reduceat(middle[order], starts)
        high = np.maximum.reduceat(middle[order], starts)
        axis = np.argmax(high - low, axis=1)[node]
        order = order[np.lexsort([middle[order, axis], node])]
    leaf = np.arange(count) * slots // count
    leaf_of = np.empty(count, np.int32)
    leaf_of[order] = leaf
    # Leaves without a triangle have the box of the one before, and no power.
    nearest = order[np.searchsorted(leaf, np.arange(slots), side="right") - 1]
    low, high = corners.min(axis=1)[nearest], corners.max(axis=1)[nearest]
    share = np.zeros(slots)
    share[leaf] = power[order]
    nodes = np.zeros((2 * slots, 2, 4), np.float32)
    for level in range(levels, -1, -1):
        at, box = slice(1 << level, 2 << level), high - low
        nodes[at, 0, :3] = low + 0.5 * box
        nodes[at, 0, 3] = share
        nodes[at, 1, 0] = 0.25 * np.einsum("ni,ni->n", box, box)
        if level:
            low, high = low.reshape(-1, 2, 3).min(axis=1), high.reshape(-1, 2, 3).max(axis=1)
            share = share.reshape(-1, 2).sum(axis=1)
    nodes[slots:, 1, 1] = nearest.astype(np.int32).view(np.float32)
    return LampTree(levels, nodes, leaf_of)
