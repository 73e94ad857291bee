"""Triangles of mesh files as stored: of glTF from its accessors, of PLY, OBJ and STL by trimesh.

Specification: Khronos glTF 2.0, section 3.7 (meshes).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from iprt.device.kept import Arrays, kept
from iprt.errors import FormatError
from iprt.files.images import decode_srgb
from iprt.files.safe_reading import MAX_TRIANGLES, MAX_VERTICES
from iprt.geometry.animation import Float, Skeleton
from iprt.geometry.gltf_check import READ_ATTRIBUTES
from iprt.geometry.gltf_document import (
    TRIANGLE_STRIP,
    TRIANGLES,
    GltfMesh,
    Primitive,
)
from iprt.geometry.gltf_skin import read_bones, require_few_vertices, scene_nodes, skin_of
from iprt.geometry.gltf_surfaces import UV_SETS, GltfMaterial
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.place import ALL_ALIKE, IDENTITY, Place, Places

Ints = NDArray[np.int64]
Float32 = NDArray[np.float32]

WORTH_KEEPING = 2**14
"""Bytes of a file from which its shapes are kept."""
KEPT = ("positions", "normals", "uvs", "triangles")
"""Attributes of a kept shape."""


@dataclass(frozen=True)
class Shape:
    """Triangles with one material.

    Attributes
    ----------
    positions, normals : (V, 3) float64
        Normals are NaN where the file has none.
    uvs : (V, 2) float32
        Zero where the file has none; v = 0 is the bottom of a texture.
    triangles : (F, 3) int64
    material : GltfMaterial, UsdMaterial, trimesh material or None
    colors : (F, 3, 3) or (F, 3, 4) float32 or None
        Linear RGB, maybe with opacity, from 0 to 1 by triangle and corner; None without colors.
    primitive : Primitive or None
        The primitive of a glTF file.
    tangents : (V, 4) float64 or None
        As in `Mesh`, of a glTF file that has them and a normal map.
    uvs2 : (V, 2) float32 or None
        Like `uvs`, the other set of a glTF file whose material uses both.
    """

    positions: Float
    normals: Float
    uvs: Float32
    triangles: Ints
    material: Any
    colors: Float32 | None
    primitive: Primitive | None = None
    tangents: Float | None = None
    uvs2: Float32 | None = None

    @property
    def places(self) -> Places:
        """`Material.places` of its material."""
        return getattr(self.material, "places", ALL_ALIKE)

    @property
    def bumpy(self) -> bool:
        """True if its material has a normal map, maybe of its clear coat."""
        return self._bumps or getattr(self.material, "coat_normal_texture", None) is not None

    @property
    def tangent_place(self) -> Place | None:
        """The place of the map that tangents follow, the clear coat's if it is the only one."""
        return self.places[1] if self._bumps else self.places[3]

    @property
    def _bumps(self) -> bool:
        return getattr(self.material, "normal_texture", None) is not None

    def __post_init__(self) -> None:
        used = self.triangles
        if used.size and not (used.min() >= 0 and used.max() < len(self.positions)):
            raise ValueError("a triangle refers to a vertex that does not exist")


def resting_shapes(file: MeshFile, *, colored: bool) -> Iterator[tuple[Float, Shape]]:
    """Yield the shapes of a glTF file with their vertices' transforms, without an animation.

    Only joints place the vertices of a skin; the mesh's own node and its ancestors do not (section
    3.7.3.3).

    Yields
    ------
    matrices : (1, 3, 4) or (V, 3, 4) float64
        Transforms to scene space, one for all vertices or one for each.
    shape : Shape

    Raises
    ------
    FormatError, ValueError
        Too many vertices to deform, or damaged data.
    """
    assert file.gltf is not None
    nodes = scene_nodes(file.gltf)
    bones, pose = read_bones(file, nodes), Skeleton(nodes, {}).pose(0.0)
    count = 0
    for node, shape in gltf_shapes(file, nodes, colored=colored):
        skin = skin_of(file, bones, node, shape.primitive)
        if skin is None:
            yield pose[node][None, :3], shape
            continue
        count += len(skin.joints)
        require_few_vertices(file, count)
        yield skin.matrices(pose), shape


def gltf_shapes(
    file: MeshFile, nodes: Iterable[int], *, colored: bool
) -> Iterator[tuple[int, Shape]]:
    """Yield the shapes of nodes of a glTF file, each with the index of its node.

    Raises
    ------
    ValueError
        The data is damaged; the message is one line.
    """
    assert file.gltf is not None
    read: dict[int, list[Shape]] = {}
    for node in nodes:
        number = file.gltf.nodes[node].mesh
        if number is None:
            continue
        if number not in read:
            mesh, where = file.gltf.meshes[number], f"meshes[{number}]"
            read[number] = list(_shapes_of(file, mesh, where, colored=colored))
        for shape in read[number]:
            yield node, shape


def _shapes_of(file: MeshFile, mesh: GltfMesh, where: str, *, colored: bool) -> Iterator[Shape]:
    assert file.gltf is not None
    for primitive in mesh.primitives:
        if primitive.mode not in (TRIANGLES, TRIANGLE_STRIP):
            continue
        positions = _attribute(file, primitive, "POSITION", where)
        normals = _attribute(file, primitive, "NORMAL", where)
        material = None if primitive.material is None else file.gltf.materials[primitive.material]
        uvs = _texture_coordinates(file, primitive, material, where)
        triangles = _triangles(file, primitive, len(positions), where)
        colors = None
        if colored and "COLOR_0" in primitive.attributes:
            colors = _colors(file, primitive, material, where)[triangles]
        shape = Shape(
            positions,
            normals,
            np.nan_to_num(uvs).astype(np.float32),
            triangles,
            material,
            colors,
            primitive,
        )
        if shape.bumpy and {"NORMAL", "TANGENT"} <= primitive.attributes.keys():
            tangents = _attribute(file, primitive, "TANGENT", where)
            shape = replace(shape, tangents=tangents)
        if any(place is not None and place.second for place in shape.places):
            other = UV_SETS - 1 - (0 if material is None else material.placement[0])
            uvs2 = _attribute(file, primitive, f"TEXCOORD_{other}", where)
            uvs2 = uvs2 * (1.0, -1.0) + (0.0, 1.0)
            shape = replace(shape, uvs2=np.nan_to_num(uvs2).astype(np.float32))
        yield shape


def _colors(
    file: MeshFile, primitive: Primitive, material: GltfMaterial | None, where: str
) -> Float32:
    """Return the colors (V, 3) of a primitive, (V, 4) with opacity if its material has any."""
    given = _attribute(file, primitive, "COLOR_0", where)
    colors = np.ones((len(given), 4 if material is not None and material.has_opacity else 3))
    columns = min(given.shape[1], colors.shape[1])
    colors[:, :columns] = np.clip(np.nan_to_num(given[:, :columns]), 0.0, 1.0)
    return colors.astype(np.float32)


def _texture_coordinates(
    file: MeshFile, primitive: Primitive, material: GltfMaterial | None, where: str
) -> Float:
    """Return (V, 2), v up, of the set that the material's color uses, after its transform."""
    number, matrix = (0, IDENTITY) if material is None else material.placement
    uvs = _attribute(file, primitive, f"TEXCOORD_{number}", where)
    if matrix != IDENTITY:
        linear = np.array(matrix)
        uvs = uvs @ linear[:, :2].T + linear[:, 2]
    return uvs * (1.0, -1.0) + (0.0, 1.0)


def _attribute(file: MeshFile, primitive: Primitive, name: str, where: str) -> Float:
    """Return an attribute (V, columns), NaN where the primitive has none."""
    assert file.gltf is not None
    types, index = READ_ATTRIBUTES[name], primitive.attributes.get(name)
    if index is None:
        count = file.gltf.accessors[primitive.attributes["POSITION"]].count
        return np.full((count, int(types[0][-1])), np.nan)
    whole = name == "COLOR_0"
    return file.values(index, types, f"{where}.{name}", finite=False, fractions=whole)


def _triangles(file: MeshFile, primitive: Primitive, count: int, where: str) -> Ints:
    corners = np.arange(count)
    if primitive.indices is not None:
        indices = file.values(primitive.indices, ("SCALAR",), f"{where}.indices")
        corners = indices[:, 0].astype(np.int64)
    if primitive.mode == TRIANGLES:
        return corners.reshape(-1, 3)
    strip = np.lib.stride_tricks.sliding_window_view(corners, 3).copy()
    strip[1::2] = strip[1::2, [0, 2, 1]]
    return strip


def usd_shapes(file: MeshFile, *, colored: bool) -> Iterator[tuple[Float, Shape]]:
    """Yield the shapes of a USD file with their transforms (1, 3, 4), as `resting_shapes` does."""
    assert file.usd is not None
    contents, arrays = file.usd.contents, file.usd.arrays
    for placed, matrix in zip(contents.placed, arrays["matrices"], strict=True):
        number = placed.geometry
        positions, normals, uvs, triangles = (arrays[f"{name} {number}"] for name in KEPT)
        material = None if placed.material is None else contents.materials[placed.material]
        colors = arrays.get(f"colors {number}") if colored else None
        shape = Shape(positions, normals, uvs, triangles, material, colors)
        yield matrix[None, :3], replace(shape, uvs2=arrays.get(f"uvs2 {number}"))


def trimesh_shapes(file: MeshFile, dropped: list[str], *, colored: bool) -> list[Shape]:
    """Return the shapes of a PLY, OBJ or STL file; note other contents in `dropped`.

    Shapes without materials are kept (`iprt.device.kept`): trimesh alone takes long to import.

    Raises
    ------
    FormatError
        The meshes exceed the size limits.
    """
    if colored or file.references or len(file.data) < WORTH_KEEPING:
        return _read_shapes(file, dropped, colored=colored)

    def make() -> Arrays:
        others: list[str] = []
        shapes = _read_shapes(file, others, colored=False)
        arrays = {
            f"{name} {i}": getattr(one, name) for i, one in enumerate(shapes) for name in KEPT
        }
        return arrays | {"others": np.frombuffer("\n".join(others).encode(), np.uint8)}

    found = kept("mesh", __name__, [file.suffix, file.data], make)
    dropped += found["others"].tobytes().decode().splitlines()
    return [_kept_shape(found, i) for i in range(len(found) // len(KEPT))]


def _kept_shape(found: Arrays, number: int) -> Shape:
    positions, normals, uvs, triangles = (found[f"{name} {number}"] for name in KEPT)
    return Shape(positions, normals, uvs, triangles, None, None)


def _read_shapes(file: MeshFile, dropped: list[str], *, colored: bool) -> list[Shape]:
    import trimesh

    # trimesh gets an open file and this resolver, so it reads no other files and no network.
    with catch_warnings():
        simplefilter("ignore")
        scene = trimesh.load_scene(
            BytesIO(file.readable_data()), file_type=file.suffix[1:], resolver=file, process=False
        )
    there = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
    meshes = [geometry for geometry in there if isinstance(geometry, trimesh.Trimesh)]
    if len(meshes) < len(there):
        dropped.append("points, lines or curves")
    triangles = sum(len(geometry.faces) for geometry in meshes)
    vertices = sum(len(geometry.vertices) for geometry in meshes)
    if triangles > MAX_TRIANGLES or vertices > MAX_VERTICES:
        raise FormatError(
            f"{file.path}: {triangles} triangles and {vertices} vertices; "
            f"at most {MAX_TRIANGLES} and {MAX_VERTICES} are read"
        )
    return [_from_trimesh(geometry, colored=colored) for geometry in meshes]


def _from_trimesh(geometry: Any, *, colored: bool) -> Shape:
    positions = np.asarray(geometry.vertices, np.float64).reshape(-1, 3)
    triangles = np.asarray(geometry.faces, np.int64).reshape(-1, 3)
    normals, uvs = np.full(positions.shape, np.nan), np.zeros((len(positions), 2), np.float32)
    if "vertex_normals" in geometry._cache:  # given, not computed
        normals = np.asarray(geometry.vertex_normals, np.float64)
    textured = geometry.visual.kind == "texture"
    uv = geometry.visual.uv if textured else None
    if uv is not None and len(uv) == len(positions):
        uvs = np.nan_to_num(np.asarray(uv, np.float32)[:, :2])
    colors = None
    if colored and geometry.visual.kind == "vertex":
        colors = decode_srgb(np.asarray(geometry.visual.vertex_colors)[:, :3])[triangles]
    if colored and geometry.visual.kind == "face":
        of_face = decode_srgb(np.asarray(geometry.visual.face_colors)[:, :3])
        colors = np.repeat(of_face[:, None], 3, axis=1)
    material = geometry.visual.material if textured else None
    return Shape(positions, normals, uvs, triangles, material, colors)
