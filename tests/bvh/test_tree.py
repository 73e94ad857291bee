"""Trees hold every primitive once, boxes hold their subtrees, and depth is bounded."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.bvh import scene
from iprt.bvh.build import MESH_DEPTH, PACKET, mesh_tree
from iprt.bvh.scene import SCENE_DEPTH, STACK, SceneBuilder, scene_sizes, shapes_of
from iprt.bvh.tree import Tree, build_tree, fit
from iprt.bvh.wide import NO_CHILD, REFERENCES, wide_count, widen
from iprt.errors import SceneError
from iprt.files.safe_reading import MAX_OBJECTS
from iprt.geometry.mesh import Mesh
from tests.bvh.meshes import fan, growing, instance_of, same_centres
from tests.meshes import transform

Floats = NDArray[np.float32]


def boxes_of(mesh: Mesh) -> tuple[Floats, Floats]:
    corners = mesh.positions[mesh.triangles]
    return corners.min(axis=1), corners.max(axis=1)


def is_tree(tree: Tree, primitives: int) -> bool:
    """Return True if this is a tree over `primitives` that kernels can traverse."""
    arrays = (tree.order, tree.first, tree.children.ravel(), tree.levels)
    if any(array.dtype != np.int32 or array.ndim != 1 for array in arrays):
        return False
    leaves = -(-primitives // PACKET)
    if len(tree.first) != leaves + 1 or tree.children.shape != (leaves - 1, 2):
        return False
    count = np.diff(tree.first)
    if tree.first[0] != 0 or tree.first[-1] != primitives or not 1 <= count.min() <= PACKET:
        return False
    depth = len(tree.levels) - 1
    if not 0 <= depth <= MESH_DEPTH or tree.levels[0] != 0 or tree.levels[-1] != leaves - 1:
        return False
    if count.max() > PACKET or (np.diff(tree.levels) < 1).any():
        return False
    if not np.array_equal(np.sort(tree.order), np.arange(primitives)):
        return False
    # Every node but the root, and every leaf, is a child of exactly one node in the level above.
    references = np.concatenate([np.arange(-leaves, 0), np.arange(1, leaves - 1)])
    if leaves > 1 and not np.array_equal(np.sort(tree.children.ravel()), references):
        return False
    level = np.repeat(np.arange(depth), np.diff(tree.levels))
    parent, side = np.nonzero(tree.children >= 0)
    return bool((level[tree.children[parent, side]] == level[parent] + 1).all())


def cloud(count: int, seed: int = 0) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(seed)
    low = rng.random((count, 3)).astype(np.float32)
    return low, low + np.float32(0.05) * rng.random((count, 3)).astype(np.float32)


def wide_depth(nodes: Floats) -> int:
    """Nodes on the longest way to a leaf; counts every node and leaf that is met."""
    references = nodes[:, REFERENCES].view(np.int32).reshape(-1, 8)
    used = references != NO_CHILD
    level, depth, seen, leaves = np.arange(min(len(nodes), 1)), 0, 0, 0
    while len(level):
        depth += 1
        seen += len(level)
        below = references[level][used[level]]
        leaves += int((below < 0).sum())
        level = below[below >= 0]
        assert depth <= 100
    assert seen == len(nodes)
    return depth


@pytest.mark.parametrize("count", [1, 2, 4, 5, 8, 9, 63, 64, 65, 257, 3000])
@pytest.mark.parametrize("leaf", [1, 4])
def test_every_primitive_is_in_one_leaf_below_its_boxes(count: int, leaf: int) -> None:
    low, high = cloud(count)
    tree = build_tree(low, high, leaf=leaf, max_depth=20)
    assert sorted(tree.order) == list(range(count))
    assert len(tree.first) - 1 == -(-count // leaf)
    assert np.diff(tree.first).max() <= leaf
    lower, upper = fit(tree, low, high)

    def held(reference: int) -> set[int]:
        if reference < 0:
            return set(tree.order[tree.first[~reference] : tree.first[~reference + 1]].tolist())
        found: set[int] = set()
        for side in range(2):
            below = held(int(tree.children[reference, side]))
            members = list(below)
            np.testing.assert_array_equal(lower[reference, side], low[members].min(axis=0))
            np.testing.assert_array_equal(upper[reference, side], high[members].max(axis=0))
            assert not below & found
            found |= below
        return found

    assert held(0 if len(tree.children) else -1) == set(range(count))


def test_the_heuristic_pays() -> None:
    """Far fewer boxes are hit than in a tree that halves along the widest axis."""
    low, high = cloud(3000)
    low[:500] += np.float32([20.0, 0.0, 0.0])
    high[:500] += np.float32([20.0, 0.0, 0.0])

    def cost(tree: Tree) -> float:
        lower, upper = fit(tree, low, high)
        size = (upper - lower).astype(np.float64)
        area = size[..., 0] * size[..., 1] + size[..., 2] * (size[..., 0] + size[..., 1])
        return float(area.sum())

    # At this depth every split must be a halving.
    halved = build_tree(low, high, leaf=4, max_depth=int(np.ceil(np.log2(len(low) / 4))))
    assert cost(mesh_tree(low, high)) < 0.8 * cost(halved)
    small = slice(0, 1000)
    assert is_tree(mesh_tree(low[small], high[small]), 1000)


@pytest.mark.parametrize(
    "mesh", [same_centres(5000), fan(5000), growing(120)], ids=["same", "fan", "growing"]
)
@pytest.mark.parametrize("spare", [0, 1, 3, MESH_DEPTH])
def test_depth_is_bounded(mesh: Mesh, spare: int) -> None:
    low, high = boxes_of(mesh)
    least = int(np.ceil(np.log2(-(-len(low) // PACKET))))
    tree = build_tree(low, high, leaf=PACKET, max_depth=min(least + spare, MESH_DEPTH))
    assert tree.depth <= min(least + spare, MESH_DEPTH)
    assert is_tree(tree, len(low))


def test_the_stack_holds_what_both_trees_need() -> None:
    """Each level leaves at most one node to come back to."""
    for depth, levels in ((MESH_DEPTH, 22), (SCENE_DEPTH, 10)):
        assert depth == levels
    low, high = boxes_of(growing(100))
    deep = build_tree(low, high, leaf=1, max_depth=MESH_DEPTH)
    assert deep.depth == MESH_DEPTH  # the heuristic asked for more
    deepest = wide_depth(widen(deep, *fit(deep, low, high)))
    assert deepest == -(-MESH_DEPTH // 3)
    assert deepest + -(-SCENE_DEPTH // 3) == STACK


@pytest.mark.parametrize("count", [1, 4, 5, 16, 17, 100, 4096, 5000])
def test_wide_nodes_are_as_many_as_planned(count: int) -> None:
    low, high = cloud(count)
    tree = mesh_tree(low, high)
    nodes = widen(tree, *fit(tree, low, high))
    assert len(nodes) <= wide_count(len(tree.first) - 1)
    wide_depth(nodes)
    references = nodes[:, REFERENCES].view(np.int32)
    references = references[references != NO_CHILD]
    assert sorted(~references[references < 0]) == list(
        range(len(tree.first) - 1 if len(nodes) else 0)
    )


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
def test_boxes_of_wide_nodes_hold_their_children_closely(unit: float) -> None:
    """Boxes in steps, decoded in float64, reach at most a step beyond the children's."""
    low, high = (np.float32(unit) * corner for corner in cloud(1000))
    tree = mesh_tree(low, high)
    nodes = widen(tree, *fit(tree, low, high))
    references = nodes[:, REFERENCES].view(np.int32).reshape(-1, 8)
    flat = nodes.reshape(len(nodes), -1)
    corner, step = flat[:, None, :3].astype(np.float64), flat[:, None, 3:6].astype(np.float64)
    steps = np.ascontiguousarray(flat[:, 6:18]).view(np.uint8).reshape(-1, 3, 2, 8)
    boxes = corner[..., None] + step[..., None] * steps.transpose(0, 3, 1, 2)

    def held(reference: int) -> NDArray[np.int32]:
        if reference < 0:
            return tree.order[tree.first[~reference] : tree.first[~reference + 1]]
        return np.concatenate([held(r) for r in references[reference] if r != NO_CHILD])

    for node, child in np.argwhere(references != NO_CHILD):
        below = held(int(references[node, child]))
        gap_low = low[below].min(axis=0) - boxes[node, child, :, 0]
        gap_high = boxes[node, child, :, 1] - high[below].max(axis=0)
        for gap in (gap_low, gap_high):
            assert (gap >= 0.0).all()
            assert (gap <= 1.001 * step[node, 0]).all()


def test_more_objects_than_the_tree_has_room_for_are_refused() -> None:
    mesh = same_centres(1)
    places = [transform(position=(3.0 * i, 0.0, 0.0)) for i in range(MAX_OBJECTS + 1)]
    instances = [instance_of(mesh, place) for place in places]
    assert len(SceneBuilder().build(instances[:-1]).instances) == MAX_OBJECTS
    with pytest.raises(SceneError) as refusal:
        SceneBuilder().build(instances)
    line = f"the scene has {MAX_OBJECTS + 1} objects, more than {MAX_OBJECTS}: join their meshes"
    assert str(refusal.value) == line


def test_more_nodes_than_a_stack_entry_can_name_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    instance = instance_of(same_centres(100))
    sizes = scene_sizes(shapes_of([instance]))
    monkeypatch.setattr(scene, "MAX_NODES", sizes.nodes)
    assert scene_sizes(shapes_of([instance])) == sizes
    monkeypatch.setattr(scene, "MAX_NODES", sizes.nodes - 1)
    with pytest.raises(SceneError, match=f"has {sizes.nodes} nodes, more than {sizes.nodes - 1}"):
        scene_sizes(shapes_of([instance]))
