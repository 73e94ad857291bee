"""The two-level hierarchy of a scene: bottom-level trees of meshes, and a tree over instances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from iprt.bvh.build import (
    MAX_TRIANGLES,
    MESH_DEPTH,
    PACKET_ROWS,
    MeshBvh,
    build_mesh,
    drawable,
    packet_count,
)
from iprt.bvh.cache import cached_tree
from iprt.bvh.tree import build_tree, fit
from iprt.bvh.wide import (
    LEVELS,
    NO_CHILD,
    NODE_ROWS,
    REFERENCES,
    relocated,
    relocated_root,
    wide_count,
    widen,
)
from iprt.device.kernel_source import constant
from iprt.errors import SceneError
from iprt.files.safe_reading import MAX_OBJECTS
from iprt.geometry.mesh import Instance, Mesh, cofactors, transformed
from iprt.geometry.tangents import moved_tangents

Floats = NDArray[np.float32]
Float = NDArray[np.float64]

SCENE_DEPTH = (MAX_OBJECTS - 1).bit_length()
"""Largest depth of the tree over instances."""
INSTANCE_ROWS = constant("lib/world/objects/bvh.h", "BVH_INSTANCE_ROWS")
STACK = -(-MESH_DEPTH // LEVELS) + -(-SCENE_DEPTH // LEVELS)
"""Entries on a ray's traversal stack, `-D BVH_STACK`, enough for both levels."""
MAX_NODES = 1 << 24
"""Nodes whose numbers fit into an entry of a GPU's stack, beside a bit for each child."""
_SPREAD = 4.0
"""Largest factor by which a round trip through object space may amplify rounding errors."""


@dataclass(frozen=True)
class Shape:
    """The triangles of a bottom-level tree.

    They are in object space, recentred if far from the origin, or baked into world space.

    Attributes
    ----------
    baked : (4, 4) float64 or None
        Transform of the vertices, for instances whose transform has no good inverse.
    """

    mesh: Mesh
    baked: Float | None

    @property
    def key(self) -> tuple[int, bytes]:
        """Key that is equal for shapes that can share a tree."""
        return id(self.mesh), b"" if self.baked is None else self.baked.tobytes()

    def place(self) -> tuple[Floats, Float]:
        """Return the tree's vertices (V, 3), and the (4, 4) matrix from there to object space.

        The matrix leads to world space instead if the shape is baked.
        """
        points = self.mesh.positions.astype(np.float64)
        if self.baked is not None:
            points = transformed(self.baked, points)
        finite = points[np.isfinite(points).all(axis=1)]
        low, high = finite.min(axis=0), finite.max(axis=0)
        # Recentre only distant meshes: near the origin float32 has digits to spare.
        far = np.abs(0.5 * (low + high)) > high - low
        centre = np.where(far, 0.5 * (low + high), 0.0)
        back = np.eye(4)
        back[:3, 3] = centre
        return (points - centre).astype(np.float32), back

    def displacements(self, before: Mesh) -> Floats:
        """Return (V, 3) offsets to the vertices of the mesh `before`, in the space of `place`."""
        step = before.positions.astype(np.float64) - self.mesh.positions
        if self.baked is not None:
            step = step @ self.baked[:3, :3].T
        return step.astype(np.float32)

    def normals(self) -> Floats:
        """Return the (V, 3) normals in the space of `place`."""
        if self.baked is None:
            return self.mesh.normals
        return (self.mesh.normals @ cofactors(self.baked[:3, :3]).T).astype(np.float32)

    def tangents(self) -> Floats:
        """Return the (V, 4) tangents in the space of `place`; 0 without."""
        tangents = self.mesh.tangents
        if tangents is None:
            return np.zeros((len(self.mesh.positions), 4), np.float32)
        if self.baked is None:
            return tangents
        return moved_tangents(tangents, self.baked[None, :3]).astype(np.float32)

    def second_uvs(self) -> Floats:
        """Return the (V, 2) coordinates `Mesh.uvs2`; 0 without."""
        return np.zeros_like(self.mesh.uvs) if self.mesh.uvs2 is None else self.mesh.uvs2


@dataclass(frozen=True)
class SceneSizes:
    """Row counts of a scene's buffers, known without building a tree."""

    nodes: int
    packets: int
    instances: int
    vertices: int


@dataclass(frozen=True)
class SceneBvh:
    """The buffers that `cl/lib/world/objects/objects_bvh.h` reads.

    Attributes
    ----------
    nodes, packets, instances : (N, 8, 4), (L, 9, 4), (I, 7, 4) float32
        See `cl/lib/world/objects/bvh.h`; I is the number of instances with triangles.
    triangles : (4 L, 4) int32
        Three vertices and the mesh's material, per place of a packet.
    normals : (V, 4) float32
    uvs : (V, 2) float32
    uvs2 : (V, 2) float32 or None
        As in `Mesh`; None if no mesh has any.
    tangents : (V, 4) float32 or None
        As in `Mesh`, in the space of their tree. None if no mesh has any.
    displacements : (V, 4) float32 or None
        Offsets to the previous state's vertices, in the space of their tree. None if no mesh
        deformed.
    instance_of : (I,) int32
        Index of each in the given instances.
    places_of : (I, 2) int32
        First place in the packets of each one's triangles, and the end.
    slots : (4 L,) int32
        Triangle of the mesh per place of a packet, or -1.
    """

    nodes: Floats
    packets: Floats
    instances: Floats
    triangles: NDArray[np.int32]
    normals: Floats
    uvs: Floats
    uvs2: Floats | None
    tangents: Floats | None
    displacements: Floats | None
    instance_of: NDArray[np.int32]
    places_of: NDArray[np.int32]
    slots: NDArray[np.int32]


def shapes_of(instances: Sequence[Instance]) -> list[Shape | None]:
    """Return the shape of each instance, or None for an instance without drawable triangles.

    Raises
    ------
    SceneError
        There are too many instances, or one has too many triangles.
    """
    if len(instances) > MAX_OBJECTS:
        raise SceneError(
            f"the scene has {len(instances)} objects, more than {MAX_OBJECTS}: join their meshes"
        )
    shapes: list[Shape | None] = []
    for instance in instances:
        shape = Shape(instance.mesh, None if _invertible(instance.to_world) else instance.to_world)
        triangles = len(drawable(instance.mesh.positions, instance.mesh.triangles))
        if triangles > MAX_TRIANGLES:
            raise SceneError(
                f"object {instance.name} has {triangles} triangles, more than {MAX_TRIANGLES}: "
                "simplify it"
            )
        shapes.append(shape if triangles > 0 else None)
    return shapes


def scene_sizes(shapes: Sequence[Shape | None]) -> SceneSizes:
    """Return the row counts of the buffers of these shapes.

    Raises
    ------
    SceneError
        The meshes have too many triangles in all.
    """
    unique = {shape.key: shape.mesh for shape in shapes if shape is not None}
    packets = [packet_count(len(drawable(m.positions, m.triangles))) for m in unique.values()]
    instances = sum(shape is not None for shape in shapes)
    nodes = wide_count(max(instances, 1)) + sum(wide_count(count) for count in packets)
    if nodes > MAX_NODES:
        raise SceneError(
            f"the hierarchy of the objects has {nodes} nodes, more than {MAX_NODES}: "
            "simplify their meshes"
        )
    return SceneSizes(
        nodes=nodes,
        packets=sum(packets),
        instances=instances,
        vertices=sum(len(mesh.positions) for mesh in unique.values()),
    )


class SceneBuilder:
    """A builder of scene hierarchies that reuses trees between the states of a scene.

    An unchanged mesh keeps its tree. A mesh that replaces another with the same triangles gets the
    old tree, refitted to its vertices.
    """

    def __init__(self) -> None:
        self._before: dict[int, tuple[Shape, MeshBvh]] = {}

    def build(self, instances: Sequence[Instance]) -> SceneBvh:
        """Build the hierarchy of the scene's current state."""
        shapes = shapes_of(instances)
        built: dict[tuple[int, bytes], int] = {}
        trees: list[tuple[Shape, MeshBvh]] = []
        bent: list[Mesh | None] = []
        for index, shape in enumerate(shapes):
            if shape is not None and shape.key not in built:
                built[shape.key] = len(trees)
                trees.append((shape, self._tree(index, shape)))
                bent.append(self._bent_from(index, shape))
        present = [index for index, shape in enumerate(shapes) if shape is not None]
        numbers = [built[shape.key] for shape in shapes if shape is not None]
        self._before = {i: trees[number] for i, number in zip(present, numbers, strict=True)}
        scene = _assemble(instances, present, numbers, trees)
        return replace(scene, displacements=_displacements(trees, bent))

    def _tree(self, index: int, shape: Shape) -> MeshBvh:
        if index in self._before:
            before, tree = self._before[index]
            if before.key == shape.key:
                return tree
            if _same_triangles(before.mesh, shape.mesh):
                return tree.refitted(shape.place()[0], shape.mesh.triangles)
        return build_mesh(shape.mesh, shape.place()[0], cached_tree)

    def _bent_from(self, index: int, shape: Shape) -> Mesh | None:
        """Return the instance's previous mesh if its vertices have moved since, else None."""
        before = self._before[index][0].mesh if index in self._before else shape.mesh
        same = before is shape.mesh or before.positions.shape != shape.mesh.positions.shape
        return None if same else before


def object_bounds(instances: Sequence[Instance], *, margin: float) -> Floats:
    """Return the (N, 2, 4) float32 corners of each instance's world-space bounding box.

    Each box grows by `margin` of its diagonal on all sides. An instance without triangles has a
    point at its origin.
    """
    bounds = np.zeros((len(instances), 2, 4), np.float32)
    for box, instance in zip(bounds, instances, strict=True):
        low, high = _world_box(instance)
        size = margin * float(np.linalg.norm(high - low))
        box[0, :3], box[1, :3] = low - size, high + size
    return bounds


def _world_box(instance: Instance) -> tuple[Float, Float]:
    mesh, matrix = instance.mesh, instance.to_world
    used = np.zeros(len(mesh.positions), bool)
    used[mesh.triangles[drawable(mesh.positions, mesh.triangles)]] = True
    if not used.any():
        return matrix[:3, 3], matrix[:3, 3]
    points = transformed(matrix, mesh.positions[used].astype(np.float64))
    return points.min(axis=0), points.max(axis=0)


def _assemble(
    instances: Sequence[Instance],
    present: Sequence[int],
    numbers: Sequence[int],
    trees: Sequence[tuple[Shape, MeshBvh]],
) -> SceneBvh:
    """Concatenate the trees; `numbers` gives the tree of each `present` instance."""
    first_node, first_packet, first_vertex = wide_count(max(len(present), 1)), 0, 0
    upper = np.zeros((first_node, NODE_ROWS, 4), np.float32)
    nodes, packets = [upper], [np.zeros((0, PACKET_ROWS, 4), np.float32)]
    triangles, normals = [np.zeros((0, 4), np.int32)], [np.zeros((0, 4), np.float32)]
    uvs, slots = [np.zeros((0, 2), np.float32)], [np.zeros(0, np.int32)]
    roots, places = [], []
    for shape, tree in trees:
        mesh = shape.mesh
        nodes.append(relocated(tree.nodes, first_node, first_packet))
        roots.append(relocated_root(tree.nodes, first_node, first_packet))
        packets.append(tree.packets)
        corners = np.zeros((len(tree.slots), 4), np.int32)
        filled = tree.slots >= 0
        corners[filled, :3] = mesh.triangles[tree.slots[filled]] + first_vertex
        corners[filled, 3] = mesh.material_index[tree.slots[filled]]
        triangles.append(corners)
        normals.append(np.pad(shape.normals(), ((0, 0), (0, 1))))
        uvs.append(mesh.uvs)
        slots.append(tree.slots)
        places.append((4 * first_packet, 4 * (first_packet + len(tree.packets))))
        first_node += len(tree.nodes)
        first_packet += len(tree.packets)
        first_vertex += len(mesh.positions)
    second = any(shape.mesh.uvs2 is not None for shape, _ in trees)
    bumpy = any(shape.mesh.tangents is not None for shape, _ in trees)
    first_material = np.cumsum([0, *(len(i.mesh.materials) for i in instances)])
    rows = np.zeros((len(present), INSTANCE_ROWS, 4), np.float32)
    for row, index, number in zip(rows, present, numbers, strict=True):
        row[:6] = _transforms(trees[number][0], instances[index])
        row[6].view(np.int32)[:2] = roots[number], first_material[index]
    if present:
        above = _instance_tree([instances[index] for index in present])
        upper[: len(above)] = above
    return SceneBvh(
        np.concatenate(nodes),
        np.concatenate(packets),
        rows,
        np.concatenate(triangles),
        np.concatenate(normals),
        np.concatenate(uvs),
        np.concatenate([shape.second_uvs() for shape, _ in trees]) if second else None,
        np.concatenate([shape.tangents() for shape, _ in trees]) if bumpy else None,
        None,
        np.array(present, np.int32),
        np.reshape([places[number] for number in numbers], (-1, 2)).astype(np.int32),
        np.concatenate(slots),
    )


def _displacements(
    trees: Sequence[tuple[Shape, MeshBvh]], bent: Sequence[Mesh | None]
) -> Floats | None:
    if all(before is None for before in bent):
        return None
    rows = [
        np.zeros((len(shape.mesh.positions), 3), np.float32)
        if before is None
        else shape.displacements(before)
        for (shape, _), before in zip(trees, bent, strict=True)
    ]
    return np.pad(np.concatenate(rows), ((0, 0), (0, 1)))


def _transforms(shape: Shape, instance: Instance) -> Floats:
    """Return (6, 4): three rows of object from world, then three of world from object."""
    forward = shape.place()[1]
    if shape.baked is None:
        forward = instance.to_world @ forward
    return np.concatenate([np.linalg.inv(forward)[:3], forward[:3]]).astype(np.float32)


def _instance_tree(instances: Sequence[Instance]) -> Floats:
    # Object-space corners and the ray's origin there are rounded.
    boxes = object_bounds(instances, margin=1e-4)
    slack = np.float32(1e-5) * np.abs(boxes).max(axis=(1, 2))[:, None]
    low, high = boxes[:, 0, :3] - slack, boxes[:, 1, :3] + slack
    tree = build_tree(low, high, leaf=1, max_depth=SCENE_DEPTH)
    # Leaves are instances: a leaf's number becomes the number of its only primitive.
    nodes = widen(tree, *fit(tree, low, high))
    references = nodes[:, REFERENCES].view(np.int32)
    leaves = (references < 0) & (references != NO_CHILD)
    references[leaves] = ~tree.order[~references[leaves]]
    return nodes


def _invertible(matrix: Float) -> bool:
    """Return True if float32 coordinates survive the transform to object space and back."""
    linear = matrix[:3, :3]
    if not np.linalg.cond(linear) < 1e12:
        return False
    spread = np.abs(linear) @ np.abs(np.linalg.inv(linear))
    return bool(spread.sum(axis=1).max() < _SPREAD)


def _same_triangles(a: Mesh, b: Mesh) -> bool:
    return (
        a.positions.shape == b.positions.shape
        and (a.triangles is b.triangles or np.array_equal(a.triangles, b.triangles))
        and np.array_equal(drawable(a.positions, a.triangles), drawable(b.positions, b.triangles))
    )
