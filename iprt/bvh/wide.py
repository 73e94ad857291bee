"""Conversion of binary trees to trees with eight children, for `cl/lib/world/objects/bvh.h`."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from iprt.bvh.tree import Tree
from iprt.device.kernel_source import constant

Floats = NDArray[np.float32]
T = TypeVar("T", np.float32, np.int32)

NODE_ROWS = constant("lib/world/objects/bvh.h", "BVH_NODE_ROWS")
LEVELS = 3
"""Binary levels that become one level."""
REFERENCES = slice(6, 8)
"""Rows of a node that hold its references."""
NO_CHILD = -(2**31)
"""Reference where there is no child."""
_STEPS = 255


def wide_count(leaves: int) -> int:
    """Return an upper bound of the number of wide nodes above this many leaves.

    Binary nodes whose depth is a multiple of three remain. Above each, except the root, there is
    at least a half of a node and a quarter of one that do not.
    """
    return (4 * (leaves - 1) + 3) // 7


def widen(tree: Tree, lower: Floats, upper: Floats) -> Floats:
    """Collapse three binary levels into one level with eight children per node.

    Parameters
    ----------
    lower, upper : (N, 2, 3) float32
        Boxes of both children, from `fit`.

    Returns
    -------
    (W, 8, 4) float32
        Nodes, level by level. References count from the first node; leaves keep their numbers.
    """
    packed = [np.zeros((0, NODE_ROWS, 4), np.float32)]
    level = np.arange(min(len(tree.children), 1), dtype=np.int32)
    count = 0
    while len(level) > 0:
        reference = level[:, None]
        low = high = np.zeros((len(level), 1, 3), np.float32)
        for _ in range(LEVELS):
            inner, node = reference >= 0, np.maximum(reference, 0)
            low = _opened(inner, lower[node], low, np.inf)
            high = _opened(inner, upper[node], high, -np.inf)
            reference = _opened(inner, tree.children[node], reference, NO_CHILD)
        below = reference >= 0
        count += len(level)
        nodes = _quantised(low, high)
        level = reference[below]
        reference[below] = count + np.arange(len(level))
        nodes[:, REFERENCES] = reference.reshape(-1, 2, 4).view(np.float32)
        packed.append(nodes)
    return np.concatenate(packed)


def _opened(
    inner: NDArray[np.bool_], children: NDArray[T], own: NDArray[T], none: float
) -> NDArray[T]:
    """Return values (W, 2 K, ...) of both children (W, K, 2, ...) of inner nodes.

    A leaf's `own` (W, K, ...) stays in the place of its first child, beside `none`.
    """
    inner = inner.reshape(*inner.shape, *[1] * (own.ndim - 2))
    first = np.where(inner, children[:, :, 0], own)
    second = np.where(inner, children[:, :, 1], own.dtype.type(none))
    return np.stack([first, second], axis=2).reshape(len(own), -1, *own.shape[2:])


def _quantised(low: Floats, high: Floats) -> Floats:
    """Return nodes (W, 8, 4), without references, whose children's boxes hold the given ones.

    Parameters
    ----------
    low, high : (W, 8, 3) float32
        Corners of the children's boxes; inf and -inf where there is no child.
    """
    there = low <= high
    corner = low.min(axis=1)
    extent = high.max(axis=1) - corner.astype(np.float64)
    step = np.nextafter((extent / _STEPS).astype(np.float32), np.float32(np.inf))
    # In float64, steps from the corner are exact enough to be rounded outwards.
    first, last = (
        np.where(there, box - corner.astype(np.float64)[:, None], 0.0) / step[:, None]
        for box in (low, high)
    )
    bounds = np.stack([np.floor(first), np.minimum(np.ceil(last), _STEPS)], axis=1)
    nodes = np.zeros((len(low), NODE_ROWS * 4), np.float32)
    nodes[:, :3], nodes[:, 3:6] = corner, step
    # (node, low or high, child, axis) to (node, axis, low or high, child).
    packed = np.ascontiguousarray(bounds.astype(np.uint8).transpose(0, 3, 1, 2))
    nodes[:, 6:18] = packed.reshape(len(low), -1).view(np.float32)
    return nodes.reshape(-1, NODE_ROWS, 4)


def relocated(nodes: Floats, first_node: int, first_leaf: int) -> Floats:
    """Return the nodes with references offset to their place in shared buffers."""
    moved = nodes.copy()
    references = moved[:, REFERENCES].view(np.int32)
    references[references >= 0] += first_node
    references[(references < 0) & (references != NO_CHILD)] -= first_leaf
    return moved


def relocated_root(nodes: Floats, first_node: int, first_leaf: int) -> int:
    """Return the reference of a relocated tree's root: its first node, or its only leaf."""
    return first_node if len(nodes) else ~first_leaf
