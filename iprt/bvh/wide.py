"""Conversion of binary trees to trees with four children, for `cl/lib/world/objects/bvh.h`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.bvh.tree import Tree
from iprt.device.kernel_source import constant

Floats = NDArray[np.float32]

NODE_ROWS = constant("lib/world/objects/bvh.h", "BVH_NODE_ROWS")
STACK_PER_LEVEL = 3


def wide_count(leaves: int) -> int:
    """Return an upper bound of the number of wide nodes above this many leaves.

    Binary nodes of even depth remain. Below each node of odd depth there are at most two of them.
    """
    return (2 * (leaves - 1) + 1) // 3


def widen(tree: Tree, lower: Floats, upper: Floats) -> Floats:
    """Collapse each pair of binary levels into one level with four children per node.

    Parameters
    ----------
    lower, upper : (N, 2, 3) float32
        Boxes of both children, from `fit`.

    Returns
    -------
    (W, 7, 4) float32
        Nodes, level by level. References count from the first node; leaves keep their numbers.
    """
    packed = [np.zeros((0, NODE_ROWS, 4), np.float32)]
    level = np.arange(min(len(tree.children), 1))
    count = 0
    while len(level) > 0:
        child = tree.children[level]
        inner = child >= 0
        # (node, child, grandchild); a leaf takes the place of its first grandchild.
        reference = np.full((*child.shape, 2), -1, np.int32)
        low = np.full((*reference.shape, 3), np.inf, np.float32)
        high = np.full((*reference.shape, 3), -np.inf, np.float32)
        reference[inner] = tree.children[child[inner]]
        low[inner], high[inner] = lower[child[inner]], upper[child[inner]]
        reference[~inner, 0] = child[~inner]
        low[~inner, 0], high[~inner, 0] = lower[level][~inner], upper[level][~inner]

        below = reference >= 0
        following = reference[below]
        count += len(level)
        reference[below] = count + np.arange(len(following))
        nodes = np.empty((len(level), NODE_ROWS, 4), np.float32)
        nodes[:, 0:6:2] = low.reshape(-1, 4, 3).transpose(0, 2, 1)
        nodes[:, 1:6:2] = high.reshape(-1, 4, 3).transpose(0, 2, 1)
        nodes[:, 6] = reference.reshape(-1, 4).view(np.float32)
        packed.append(nodes)
        level = following
    return np.concatenate(packed)


def relocated(nodes: Floats, first_node: int, first_leaf: int) -> Floats:
    """Return the nodes with references offset to their place in shared buffers."""
    moved = nodes.copy()
    references = moved[:, 6].view(np.int32)
    references += np.where(references >= 0, first_node, -first_leaf).astype(np.int32)
    return moved


def relocated_root(nodes: Floats, first_node: int, first_leaf: int) -> int:
    """Return the reference of a relocated tree's root: its first node, or its only leaf."""
    return first_node if len(nodes) else ~first_leaf
