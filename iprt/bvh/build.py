"""Bounding volume hierarchies of meshes, laid out as in `cl/lib/world/objects/bvh.h`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.bvh.tree import Tree, build_tree, fit
from iprt.bvh.wide import widen
from iprt.device.kernel_source import constant
from iprt.geometry.mesh import Mesh

Floats = NDArray[np.float32]

PACKET = 4
"""Triangles that a kernel tests at once; a leaf is a packet."""
PACKET_ROWS = constant("lib/world/objects/bvh.h", "BVH_PACKET_ROWS")
"""float4 rows per packet, one for each coordinate of the corners."""
MESH_DEPTH = 22
"""Largest depth of a mesh's tree."""
MAX_TRIANGLES = PACKET << MESH_DEPTH
_LINE = 2.0**-22
"""Triangles lower than this fraction of their longest edge count as lines and are never hit."""
_PADDING = 2.0**-21
"""Boxes grow by this fraction of the largest coordinate, which is several units in the last
place."""


@dataclass(frozen=True)
class MeshBvh:
    """The bounding volume hierarchy of one mesh.

    Attributes
    ----------
    tree : Tree
        Binary tree with packets as leaves.
    slots : (4 * L,) int32
        Triangle of the mesh at each place of each packet, or -1.
    nodes : (W, 8, 4) float32
        Wide nodes; references count within this mesh.
    packets : (L, 9, 4) float32
    """

    tree: Tree
    slots: NDArray[np.int32]
    nodes: Floats
    packets: Floats

    def refitted(self, positions: Floats, triangles: NDArray[np.int32]) -> MeshBvh:
        """Return the tree refitted to moved vertices (V, 3) of the same triangles."""
        nodes, packets = _fitted(self.tree, self.slots, positions, triangles)
        return MeshBvh(self.tree, self.slots, nodes, packets)


def drawable(positions: Floats, triangles: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return the indices of the triangles with finite corners."""
    finite = np.asarray(np.isfinite(positions).all(axis=1))
    if finite.all():
        return np.arange(len(triangles))
    return np.flatnonzero(finite[triangles].all(axis=1))


def packet_count(triangles: int) -> int:
    """Return the number of packets of a mesh with this many drawable triangles."""
    return -(-triangles // PACKET)


def build_mesh(
    mesh: Mesh,
    positions: Floats,
    tree_of: Callable[[Floats, Floats], Tree] | None = None,
) -> MeshBvh:
    """Build the tree of a mesh that has drawable triangles.

    Parameters
    ----------
    positions : (V, 3) float32
        Vertex positions in the space of the tree.
    tree_of : callable, optional
        Replaces `mesh_tree`; called with lower and upper corners (P, 3) of the drawable triangles.
    """
    used = drawable(positions, mesh.triangles)
    corners = positions[mesh.triangles[used]]
    tree = (tree_of or mesh_tree)(corners.min(axis=1), corners.max(axis=1))
    slots = np.full(PACKET * (len(tree.first) - 1), -1, np.int32)
    count = np.diff(tree.first)
    leaf = np.repeat(np.arange(len(count)), count)
    slots[PACKET * leaf + np.arange(len(leaf)) - tree.first[leaf]] = used[tree.order]
    nodes, packets = _fitted(tree, slots, positions, mesh.triangles)
    return MeshBvh(tree, slots, nodes, packets)


def mesh_tree(low: Floats, high: Floats) -> Tree:
    """Build a mesh's binary tree over the boxes (P, 3) of its triangles."""
    return build_tree(low, high, leaf=PACKET, max_depth=MESH_DEPTH)


def _has_area(corners: Floats) -> NDArray[np.bool_]:
    """Return (T, 1) flags: the triangles (T, 3, 3) have an area above rounding errors."""
    exact = corners.astype(np.float64)
    edges = exact - np.roll(exact, 1, axis=1)
    longest = (edges**2).sum(axis=2).max(axis=1, keepdims=True)
    height = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1, keepdims=True)
    return np.asarray(height > _LINE * longest)


def _fitted(
    tree: Tree, slots: NDArray[np.int32], positions: Floats, triangles: NDArray[np.int32]
) -> tuple[Floats, Floats]:
    """Return the nodes and packets of a tree refitted to these vertices."""
    filled = slots >= 0
    corners = positions[triangles[slots[filled]]]
    # Filled slots are in leaf order, which is also the tree's order of primitives.
    low, high = np.empty_like(corners[:, 0]), np.empty_like(corners[:, 0])
    low[tree.order], high[tree.order] = corners.min(axis=1), corners.max(axis=1)
    padding = _PADDING * float(np.abs(corners).max())
    hittable = np.full((len(slots), PACKET_ROWS), np.nan, np.float32)
    hittable[filled] = np.where(_has_area(corners), corners.reshape(-1, PACKET_ROWS), np.nan)
    # (packet, place, corner and axis) to (packet, corner and axis, place).
    packets = hittable.reshape(-1, PACKET, PACKET_ROWS).transpose(0, 2, 1)
    nodes = widen(tree, *fit(tree, low - np.float32(padding), high + np.float32(padding)))
    return nodes, np.ascontiguousarray(packets)
