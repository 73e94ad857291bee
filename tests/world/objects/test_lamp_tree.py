"""The tree of emitting triangles against a brute-force twin."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.world.objects.lamp_tree import LampTree, lamp_tree, tree_levels
from tests.worlds import Float


def scattered(count: int, seed: int = 0) -> tuple[Float, Float]:
    """Corners of small triangles, some coincident, and their power, which may be 0."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(count, 1, 3)) * (4.0, 1.0, 2.0)
    centres[: count // 4] = centres[:1]
    power = rng.exponential(size=count) * (rng.random(count) < 0.9)
    return centres + 0.05 * rng.normal(size=(count, 3, 3)), power


def chances(tree: LampTree, x: Float) -> Float:
    """(count,) probability of each triangle for a point, from the root down."""
    power, radius = tree.nodes[:, 0, 3].astype(np.float64), tree.nodes[:, 1, 0].astype(np.float64)
    away = ((tree.nodes[:, 0, :3] - x) ** 2).sum(axis=1)
    importance = power / np.maximum(np.maximum(away, radius), 1e-38)
    reached = np.ones(2)
    for level in range(tree.levels):
        first, second = importance[2 << level : 4 << level].reshape(-1, 2).T
        total = first + second
        share = np.where(total > 0.0, first / np.where(total > 0.0, total, 1.0), 1.0)
        above = reached if level else np.ones(1)
        reached = np.stack([above * share, above * (1.0 - share)], axis=1).ravel()
    return np.asarray(reached[tree.leaf_of])


@pytest.mark.parametrize("count", [2, 3, 1000, 1025])
def test_leaves_are_the_triangles(count: int) -> None:
    corners, power = scattered(count)
    tree = lamp_tree(corners, power)
    assert tree.levels == tree_levels(count) == int(np.ceil(np.log2(count)))
    assert len(np.unique(tree.leaf_of)) == count
    slots = 1 << tree.levels
    at_leaf = tree.nodes[slots + tree.leaf_of]
    triangle = np.ascontiguousarray(at_leaf[:, 1, 1]).view(np.int32)
    np.testing.assert_array_equal(triangle, np.arange(count))
    np.testing.assert_allclose(at_leaf[:, 0, 3], power, rtol=1e-6)


@pytest.mark.parametrize("count", [3, 1025])
def test_nodes_hold_their_children(count: int) -> None:
    corners, power = scattered(count)
    tree = lamp_tree(corners, power)
    slots = 1 << tree.levels
    summed = tree.nodes[2:, 0, 3].reshape(-1, 2).sum(axis=1)
    np.testing.assert_allclose(tree.nodes[1:slots, 0, 3], summed, rtol=1e-5)
    assert tree.nodes[1, 0, 3] == pytest.approx(power.sum(), rel=1e-5)
    for level in range(tree.levels + 1):
        node = (1 << level) + (tree.leaf_of >> (tree.levels - level))
        away = ((corners - tree.nodes[node, None, 0, :3]) ** 2).sum(axis=2).max(axis=1)
        assert (away <= tree.nodes[node, 1, 0] * (1.0 + 1e-4) + 1e-6).all()


def test_near_triangles_are_preferred_and_all_have_a_chance() -> None:
    corners, power = scattered(1025)
    tree = lamp_tree(corners, power)
    x = corners[900].mean(axis=0) + 0.1
    found = chances(tree, x)
    assert found.sum() == pytest.approx(1.0)
    assert (found[power > 0.0] > 0.0).all()
    assert (found[power == 0.0] == 0.0).all()
    nearness = ((corners.mean(axis=1) - x) ** 2).sum(axis=1) ** -1.0
    assert found @ nearness > 2.0 * (power / power.sum()) @ nearness
