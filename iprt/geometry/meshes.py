"""Triangle meshes from PLY, OBJ, STL and glTF files, through trimesh."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.untrusted import MAX_TRIANGLES, MAX_VERTICES, decoding
from iprt.geometry.creases import same_position, with_normals
from iprt.geometry.gltf_check import Gltf
from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.mesh_materials import Textures, convert_material, mean_color, tinted


@dataclass
class Part:
    """One geometry of the file, in object space; normals are NaN where the file has none.

    Its triangles can be drawn: they are finite and not degenerate. `material` is trimesh's, and
    `color` the mean of what vertices or faces have; None: the file has none.
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    uvs: NDArray[np.float32]
    triangles: NDArray[np.int64]
    material: Any
    color: tuple[float, float, float] | None


def load_mesh(path: Path, material: Material | None = None, within: Path | None = None) -> Mesh:
    """Load a mesh with its materials, or with one material for all of it.

    Geometries of different materials are never merged. Normals that the file lacks are flat for
    glTF, and smooth up to a crease angle for other formats (`creases.py`). Triangles that are
    degenerate or not finite are removed.

    Parameters
    ----------
    path : Path
        .ply, .obj, .stl, .gltf or .glb.
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
        placed = placed_geometries(file, dropped).values()
        parts = [part_of(geometry, transform, dropped) for transform, geometry in placed]
        if file.suffix == ".stl":
            parts = [_welded(part) for part in parts]
        mesh = joined(file, parts, material, dropped)
    if mesh.triangles.shape[0] == 0:
        raise FormatError(f"{path}: holds no triangles")
    return mesh


def _welded(part: Part) -> Part:
    """One vertex for each position, of which STL has as many as there are triangles at it."""
    number = same_position(part.positions)
    _, first = np.unique(number, return_index=True)
    return replace(
        part,
        positions=part.positions[first],
        normals=part.normals[first],
        uvs=part.uvs[first],
        triangles=number[part.triangles],
    )


def placed_geometries(
    file: MeshFile, dropped: list[str]
) -> dict[str, tuple[NDArray[np.float64], Any]]:
    """Transforms and triangles of trimesh by the name of their node; what else there is is noted.

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
            BytesIO(file.readable_data()),
            file_type=file.suffix[1:] if file.gltf is None else "gltf",
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
    textured = geometry.visual.kind == "texture"
    material = geometry.visual.material if textured else None
    uv = geometry.visual.uv if textured else None
    if uv is not None and len(uv) == len(positions):
        uvs = np.nan_to_num(np.asarray(uv, np.float32)[:, :2])
    linear = transform[:3, :3]
    if not np.allclose(transform, np.eye(4)):
        positions = positions @ linear.T + transform[:3, 3]
        normals = normals @ np.linalg.inv(linear) if np.linalg.det(linear) else normals * np.nan
        if np.linalg.det(linear) < 0.0:
            triangles = triangles[:, ::-1]
    kept = _usable_triangles(positions, triangles)
    if removed := len(triangles) - len(kept):
        _note(dropped, f"{removed} degenerate or non-finite triangles")
    positions = np.nan_to_num(positions, posinf=0.0, neginf=0.0)
    return Part(positions, normals, uvs, kept, material, mean_color(geometry))


def joined(
    file: MeshFile, parts: list[Part], override: Material | None, dropped: list[str]
) -> Mesh:
    """All parts in one mesh, with a material index per triangle."""
    materials: list[Material] = [override] if override is not None else []
    index_of: dict[tuple[int, Any], int] = {}
    factors, textures = _base_colors(file.gltf), Textures(file.path)
    columns: list[tuple[Any, ...]] = []
    offset = 0
    for part in parts:
        index = 0
        if override is None:
            if part.color is not None:
                _note(dropped, "colours of vertices or faces; their mean is used")
            key = (id(part.material), part.color)
            if key not in index_of:
                index_of[key] = len(materials)
                material = convert_material(part.material, factors, textures, dropped)
                materials.append(tinted(material, part.color))
            index = index_of[key]
        triangles = part.triangles + offset
        index_of_each = np.full(len(triangles), index)
        columns.append((part.positions, part.normals, part.uvs, triangles, index_of_each))
        offset += len(part.positions)
    if not columns:
        raise FormatError(f"{file.path}: holds no triangles")
    positions, normals, uvs, triangles, indices = (
        np.concatenate(column) for column in zip(*columns, strict=True)
    )
    flat = np.full(len(triangles), file.gltf is not None)
    source, normals, triangles = with_normals(positions, normals, triangles, flat)
    return Mesh(
        positions=positions[source].astype(np.float32),
        normals=normals.astype(np.float32),
        uvs=uvs[source].astype(np.float32),
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


def _usable_triangles(
    positions: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Triangles with finite corners and an area above rounding noise."""
    corners = positions[triangles]
    with np.errstate(invalid="ignore"):
        finite: NDArray[np.bool_] = np.all(np.abs(corners) < 1e18, axis=(1, 2))
    corners = np.where(finite[:, None, None], corners, 0.0)
    edges = corners - np.roll(corners, 1, axis=1)
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest = np.einsum("fij,fij->fi", edges, edges).max(axis=1, initial=0.0)
    return np.asarray(triangles[finite & (area > 1e-9 * longest) & (longest > 0.0)])


def _note(dropped: list[str], phrase: str) -> None:
    if phrase not in dropped:
        dropped.append(phrase)
