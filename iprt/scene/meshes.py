"""Triangle meshes from PLY, OBJ and glTF files, through trimesh."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.scene.gltf_check import Gltf
from iprt.scene.material import Material
from iprt.scene.mesh import Mesh
from iprt.scene.mesh_files import MeshFile
from iprt.scene.mesh_materials import Textures, convert_material
from iprt.scene.untrusted import MAX_TRIANGLES, MAX_VERTICES, decoding


@dataclass
class Part:
    """One geometry of the file, in object space; normals are NaN where the file has none."""

    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    uvs: NDArray[np.float32]
    triangles: NDArray[np.int64]
    material: Any


def load_mesh(path: Path, material: Material | None = None, within: Path | None = None) -> Mesh:
    """Load a mesh with its materials, or with one material for all of it.

    Geometries of different materials are never merged. Normals that the file lacks are the
    angle-weighted means of the faces around a position (Thürmer and Wüthrich, "Computing Vertex
    Normals from Polygonal Facets", 1998). Triangles that are degenerate or not finite are removed.

    Parameters
    ----------
    path : Path
        .ply, .obj, .gltf or .glb.
    material : Material or None
        Replaces those of the file.
    within : Path or None
        Folder that the files of the mesh must lie in, links followed; by default the mesh's own.

    Raises
    ------
    FormatError
        Missing, damaged, larger than is read, without triangles, or a file that it refers to is
        missing or elsewhere.
    """
    file = MeshFile(path, within)
    dropped = file.unread_parts()
    with decoding(path, "cut off or damaged mesh file"), np.errstate(all="ignore"):
        parts = _load_parts(file, dropped)
        mesh = joined(file, parts, material, dropped)
    if mesh.triangles.shape[0] == 0:
        raise FormatError(f"{path}: holds no triangles")
    return mesh


def _load_parts(file: MeshFile, dropped: list[str]) -> list[Part]:
    return [
        part_of(geometry, transform, dropped)
        for transform, geometry in placed_geometries(file, file.readable_data(), dropped).values()
    ]


def placed_geometries(
    file: MeshFile, data: bytes, dropped: list[str]
) -> dict[str, tuple[NDArray[np.float64], Any]]:
    """Transforms and triangles of trimesh by the name of their node; what else there is is noted.

    Parameters
    ----------
    file : MeshFile
    data : bytes
        Its contents, for trimesh.
    dropped : list of str

    Raises
    ------
    FormatError
        Larger than is read.
    """
    import trimesh

    # An open file and a resolver of ours: trimesh finds no other files, and asks no server.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = trimesh.load_scene(
            BytesIO(data),
            file_type=file.suffix[1:],
            resolver=file,
            process=False,
        )
    placed = {node: scene.graph[node] for node in scene.graph.nodes_geometry}
    meshes = {
        node: (np.asarray(transform, np.float64), scene.geometry[name])
        for node, (transform, name) in placed.items()
        if isinstance(scene.geometry[name], trimesh.Trimesh)
    }
    if len(meshes) < len(placed):
        _note(dropped, "points, lines or curves")
    triangles = sum(len(geometry.faces) for _, geometry in meshes.values())
    vertices = sum(len(geometry.vertices) for _, geometry in meshes.values())
    if triangles > MAX_TRIANGLES or vertices > MAX_VERTICES:
        raise FormatError(
            f"{file.path}: {triangles} triangles and {vertices} vertices; "
            f"at most {MAX_TRIANGLES} and {MAX_VERTICES} are read"
        )
    return meshes


def part_of(geometry: Any, transform: NDArray[np.float64], dropped: list[str]) -> Part:
    """A mesh of trimesh, transformed by (4, 4) float64."""
    positions = np.asarray(geometry.vertices, np.float64).reshape(-1, 3)
    triangles = np.asarray(geometry.faces, np.int64).reshape(-1, 3)
    if triangles.size and not (triangles.min() >= 0 and triangles.max() < len(positions)):
        raise ValueError("a triangle refers to a vertex that does not exist")
    given = "vertex_normals" in geometry._cache
    normals = (
        np.asarray(geometry.vertex_normals, np.float64)
        if given
        else np.full(positions.shape, np.nan)
    )
    uvs = np.zeros((len(positions), 2), np.float32)
    material = None
    if geometry.visual.kind == "texture":
        material = geometry.visual.material
        uv = geometry.visual.uv
        if uv is not None and len(uv) == len(positions):
            uvs = np.nan_to_num(np.asarray(uv, np.float32)[:, :2])
    elif geometry.visual.kind in ("vertex", "face"):
        _note(dropped, f"{geometry.visual.kind} colours")
    linear = transform[:3, :3]
    if not np.allclose(transform, np.eye(4)):
        positions = positions @ linear.T + transform[:3, 3]
        normals = normals @ np.linalg.inv(linear) if np.linalg.det(linear) else normals * np.nan
        if np.linalg.det(linear) < 0.0:
            triangles = triangles[:, ::-1]
    return Part(positions, normals, uvs, triangles, material)


def joined(
    file: MeshFile, parts: list[Part], override: Material | None, dropped: list[str]
) -> Mesh:
    """All parts in one mesh, with a material index per triangle."""
    materials: list[Material] = [override] if override is not None else []
    index_of: dict[int, int] = {}
    factors, textures = _base_colors(file.gltf), Textures(file.path)
    columns: list[tuple[Any, ...]] = []
    offset = 0
    for part in parts:
        index = 0
        if override is None:
            key = id(part.material)
            if key not in index_of:
                index_of[key] = len(materials)
                materials.append(convert_material(part.material, factors, textures, dropped))
            index = index_of[key]
        kept = _usable_triangles(part)
        if removed := len(part.triangles) - len(kept):
            dropped.append(f"{removed} degenerate or non-finite triangles")
        positions = np.nan_to_num(part.positions, posinf=0.0, neginf=0.0)
        normals = _completed_normals(positions, part.normals, kept)
        columns.append((positions, normals, part.uvs, kept + offset, np.full(len(kept), index)))
        offset += len(positions)
    if not columns:
        raise FormatError(f"{file.path}: holds no triangles")
    positions, normals, uvs, triangles, indices = (
        np.concatenate(column) for column in zip(*columns, strict=True)
    )
    return Mesh(
        positions=positions.astype(np.float32),
        normals=normals.astype(np.float32),
        uvs=uvs.astype(np.float32),
        triangles=np.ascontiguousarray(triangles, np.int32),
        material_index=indices.astype(np.int32),
        materials=tuple(materials),
        dropped=tuple(dict.fromkeys(dropped)),
    )


def _base_colors(gltf: Gltf | None) -> dict[str, list[float]]:
    """Base colours of a glTF file's materials by name, where names are unique."""
    entries = [] if gltf is None else gltf.materials
    names = Counter(entry.name for entry in entries)
    return {
        entry.name: entry.pbr_metallic_roughness.base_color_factor
        for entry in entries
        if entry.name is not None
        and names[entry.name] == 1
        and entry.pbr_metallic_roughness is not None
        and entry.pbr_metallic_roughness.base_color_factor is not None
    }


def _usable_triangles(part: Part) -> NDArray[np.int64]:
    """Triangles with finite corners and an area above rounding noise."""
    corners = part.positions[part.triangles]
    with np.errstate(invalid="ignore"):
        finite: NDArray[np.bool_] = np.all(np.abs(corners) < 1e18, axis=(1, 2))
    corners = np.where(finite[:, None, None], corners, 0.0)
    edges = corners - np.roll(corners, 1, axis=1)
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest = np.einsum("fij,fij->fi", edges, edges).max(axis=1, initial=0.0)
    usable: NDArray[np.int64] = part.triangles[finite & (area > 1e-9 * longest) & (longest > 0.0)]
    return usable


def _completed_normals(
    positions: NDArray[np.float64], given: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Unit normals: those given where they are usable, else angle-weighted ones."""
    length = np.linalg.norm(given, axis=1, keepdims=True)
    usable = np.isfinite(length[:, 0]) & (length[:, 0] > 1e-12)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit: NDArray[np.float64] = given / length
    if usable.all():
        return unit
    return np.where(usable[:, None], unit, _angle_weighted(positions, triangles))


def _angle_weighted(
    positions: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Unit normals (V, 3), equal for vertices that share a position; +Y where there is no face."""
    _, shared = np.unique(positions, axis=0, return_inverse=True)
    shared = shared.ravel()
    corners = positions[triangles]
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    face = np.cross(ahead[:, 0], behind[:, 0])
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-300)
    sine = np.linalg.norm(np.cross(ahead, behind), axis=2)
    angle = np.arctan2(sine, np.einsum("fij,fij->fi", ahead, behind))
    total = np.zeros((shared.max(initial=-1) + 1, 3))
    for corner in range(3):
        np.add.at(total, shared[triangles[:, corner]], angle[:, corner, None] * face)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = np.where(length > 1e-12, total / length, [0.0, 1.0, 0.0])
    normals: NDArray[np.float64] = unit[shared]
    return normals


def _note(dropped: list[str], phrase: str) -> None:
    if phrase not in dropped:
        dropped.append(phrase)
