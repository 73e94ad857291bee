"""Binary trees over boxes by the binned surface area heuristic, built level by level in NumPy.

See I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies" (Interactive Ray
Tracing 2007), section 3. A node is split at one of a few planes between bins of centroids. The
chosen plane has the least sum of surface area times packet count over both sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float32]

BINS = 16
_AXES = 3


@dataclass(frozen=True)
class Tree:
    """The topology of a binary tree over primitives; `fit` computes the boxes.

    A reference is the number of an inner node, or ~leaf for a leaf. Inner nodes are numbered level
    by level from the root, node 0. A single leaf has no inner nodes.

    Attributes
    ----------
    order : (P,) int32
        Primitives, leaf by leaf.
    first : (L + 1,) int32
        Leaf i holds `order[first[i]:first[i + 1]]`.
    children : (N, 2) int32
        References; N = L - 1.
    levels : (D + 1,) int32
        Level i holds the nodes `levels[i]:levels[i + 1]`; D is the tree's depth.
    """

    order: NDArray[np.int32]
    first: NDArray[np.int32]
    children: NDArray[np.int32]
    levels: NDArray[np.int32]

    @property
    def depth(self) -> int:
        """Number of inner nodes on the longest path from the root to a leaf."""
        return len(self.levels) - 1


@dataclass(frozen=True)
class _Level:
    """The nodes of one level, with their primitives sorted by centroid along each axis.

    Attributes
    ----------
    by_axis : three (P,) int64
        Primitives grouped by node, sorted along x, y and z within a node.
    count, start, segment, rank
        Primitives and first place per node; node and rank within the node per place.
    """

    by_axis: list[Ints]
    count: Ints
    start: Ints
    segment: Ints
    rank: Ints

    @classmethod
    def of(cls, by_axis: list[Ints], count: Ints) -> _Level:
        start = np.cumsum(count) - count
        segment = np.repeat(np.arange(len(count)), count)
        return cls(by_axis, count, start, segment, np.arange(int(count.sum())) - start[segment])


def build_tree(low: Floats, high: Floats, *, leaf: int, max_depth: int) -> Tree:
    """Split primitives until each leaf has at most `leaf`.

    All leaves but one are full. Kernels test all primitives of a leaf at once, at the same cost,
    and the number of leaves, ceil(P / `leaf`), is known beforehand. Nodes are halved where the
    heuristic would exceed `max_depth` levels.

    Parameters
    ----------
    low, high : (P, 3) float32
        Corners of finite boxes; P >= 1.
    max_depth : int
        P must be at most `leaf` * 2^max_depth.
    """
    total = len(low)
    assert 1 <= total <= leaf << max_depth
    low, high = _normalised(low, high)
    centre = np.float32(0.5) * (low + high)
    by_axis = [np.argsort(centre[:, axis], kind="stable") for axis in range(_AXES)]
    level = _Level.of(by_axis, np.array([total]))
    parent = np.full(1, -1)
    order, first = [np.zeros(0, np.int64)], [0]
    children: list[Ints] = []
    levels = [0]
    leaves = 0
    for depth in range(max_depth + 1):
        finished = level.count <= leaf
        reference = np.zeros(len(level.count), np.int64)
        reference[finished] = ~(leaves + np.arange(int(finished.sum())))
        reference[~finished] = levels[-1] + np.arange(int((~finished).sum()))
        if depth > 0:
            children[-1][parent[:, 0], parent[:, 1]] = reference
        leaves += int(finished.sum())
        place = finished[level.segment]
        order.append(level.by_axis[0][place])
        first += (first[-1] + np.cumsum(level.count[finished])).tolist()
        if finished.all():
            break
        level = _Level.of([ids[~place] for ids in level.by_axis], level.count[~finished])
        nodes = len(level.count)
        axis, left = _choose_splits(level, low, high, centre, leaf, leaf << (max_depth - depth - 1))
        children.append(np.zeros((nodes, 2), np.int64))
        levels.append(levels[-1] + nodes)
        level = _split(level, axis, left)
        parent = np.stack([np.repeat(np.arange(nodes), 2), np.tile([0, 1], nodes)], axis=1)
    return Tree(
        np.concatenate(order).astype(np.int32),
        np.array(first, np.int32),
        np.concatenate([np.zeros((0, 2), np.int64), *children]).astype(np.int32),
        np.array(levels, np.int32),
    )


def fit(tree: Tree, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Compute the boxes of both children of every node, bottom up from the primitives' boxes.

    It serves new trees and refits trees to moved primitives.

    Parameters
    ----------
    low, high : (P, 3) float32
        Box corners by primitive.

    Returns
    -------
    two (N, 2, 3) float32
        Lower and upper corners.
    """
    leaf_low = np.minimum.reduceat(low[tree.order], tree.first[:-1], axis=0)
    leaf_high = np.maximum.reduceat(high[tree.order], tree.first[:-1], axis=0)
    lower = np.empty((len(tree.children), 2, 3), np.float32)
    upper = np.empty_like(lower)
    for start, end in zip(tree.levels[-2::-1], tree.levels[:0:-1], strict=True):
        below = tree.children[start:end]
        inner = below >= 0
        for boxes, leaves, merge in ((lower, leaf_low, np.min), (upper, leaf_high, np.max)):
            level = boxes[start:end]
            level[~inner] = leaves[~below[~inner]]
            level[inner] = merge(boxes[below[inner]], axis=1)
    return lower, upper


def _normalised(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Scale the boxes to their common extent, so that areas neither overflow nor vanish."""
    origin = low.min(axis=0)
    extent = np.float32(max(float((high.astype(np.float64) - origin).max()), 1e-37))
    return (low - origin) / extent, (high - origin) / extent


def _choose_splits(
    level: _Level, low: Floats, high: Floats, centre: Floats, leaf: int, capacity: int
) -> tuple[Ints, Ints]:
    """Choose each node's split: the axis and the number of primitives to the left of the plane."""
    # Halving along the axis of the widest spread is always possible.
    last = level.start + level.count - 1
    spread = [
        centre[ids[last], axis] - centre[ids[level.start], axis]
        for axis, ids in enumerate(level.by_axis)
    ]
    best_axis = np.argmax(spread, axis=0)
    best_left = -(-level.count // (2 * leaf)) * leaf
    best_cost = np.full(len(level.count), np.inf, np.float32)
    for axis in range(_AXES):
        cost, left = _best_split(level, low, high, centre, axis, leaf, capacity)
        better = cost < best_cost
        best_cost[better], best_left[better], best_axis[better] = cost[better], left[better], axis
    return best_axis, best_left


def _best_split(
    level: _Level,
    low: Floats,
    high: Floats,
    centre: Floats,
    axis: int,
    leaf: int,
    capacity: int,
) -> tuple[Floats, Ints]:
    """Return each node's least cost along one axis (inf if none) and the primitives on the left."""
    ids, nodes = level.by_axis[axis], len(level.count)
    along = centre[ids, axis]
    start, last = along[level.start], along[level.start + level.count - 1]
    scale = np.divide(BINS, last - start, out=np.zeros_like(start), where=last - start > 1e-30)
    bins = ((along - start[level.segment]) * scale[level.segment]).astype(np.int64)
    # Small nodes are tried at every boundary between full leaves.
    small = (level.count <= BINS * leaf)[level.segment]
    bins = np.where(small, level.rank // leaf, np.minimum(bins, BINS - 1))
    key = level.segment * BINS + bins
    runs = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))

    filled = key[runs]
    count = np.zeros(nodes * BINS, np.int64)
    count[filled] = np.diff(np.append(runs, len(ids)))
    lower = np.full((nodes, BINS, 3), np.inf, np.float32)
    upper = np.full((nodes, BINS, 3), -np.inf, np.float32)
    lower.reshape(-1, 3)[filled] = np.minimum.reduceat(low[ids], runs, axis=0)
    upper.reshape(-1, 3)[filled] = np.maximum.reduceat(high[ids], runs, axis=0)

    left = np.cumsum(count.reshape(nodes, BINS), axis=1)[:, :-1]
    left = (left + leaf // 2) // leaf * leaf
    right = level.count[:, None] - left
    cost = _swept_area(lower, upper) * (left // leaf)
    cost += _swept_area(lower[:, ::-1], upper[:, ::-1])[:, ::-1] * -(-right // leaf)
    cost[(np.minimum(left, right) <= 0) | (np.maximum(left, right) > capacity)] = np.inf
    best = np.argmin(cost, axis=1)
    rows = np.arange(nodes)
    return cost[rows, best], left[rows, best]


def _swept_area(lower: Floats, upper: Floats) -> Floats:
    """Return half the surface area of the unions of the first 1, 2, ... (nodes, bins, 3) boxes."""
    size = np.maximum.accumulate(upper, axis=1) - np.minimum.accumulate(lower, axis=1)
    size = np.maximum(size[:, :-1], 0.0)  # empty unions are -inf
    return np.asarray(size[..., 0] * size[..., 1] + size[..., 2] * (size[..., 0] + size[..., 1]))


def _split(level: _Level, axis: Ints, left: Ints) -> _Level:
    """Partition all nodes into their children, and keep the order along each axis."""
    goes_left = np.zeros(max(int(ids.max()) for ids in level.by_axis) + 1, bool)
    for candidate, ids in enumerate(level.by_axis):
        chosen = axis[level.segment] == candidate
        goes_left[ids[chosen]] = level.rank[chosen] < left[level.segment[chosen]]
    by_axis = []
    for ids in level.by_axis:
        goes = goes_left[ids]
        before = np.cumsum(goes) - goes
        before -= before[level.start][level.segment]
        place = np.where(goes, before, left[level.segment] + level.rank - before)
        moved = np.empty_like(ids)
        moved[level.start[level.segment] + place] = ids
        by_axis.append(moved)
    return _Level.of(by_axis, np.stack([left, level.count - left], axis=1).ravel())
