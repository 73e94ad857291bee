"""Triangle meshes from PLY, OBJ, STL, glTF and USD files."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.safe_reading import decoding
from iprt.geometry.animation import moved
from iprt.geometry.creases import have_normals, same_position, with_normals
from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh
from iprt.geometry.mesh_files import MeshFile
from iprt.geometry.mesh_materials import colored, convert_material, has_texture, tinted
from iprt.geometry.mesh_shapes import Shape, resting_shapes, trimesh_shapes, usd_shapes
from iprt.geometry.place import Place
from iprt.geometry.solids import with_solids
from iprt.geometry.tangents import moved_tangents, with_tangents
from iprt.geometry.textures import Textures
from iprt.geometry.vertex_colors import color_texture

LOG = logging.getLogger("iprt.scene")


@dataclass
class Part:
    """A geometry of the file, in object space, whose triangles can be drawn.

    Triangles are finite and not degenerate.

    Attributes
    ----------
    positions, normals : (V, 3) float64
        Normals are NaN where the file has none.
    uvs : (V, 2) float32
    triangles : (F, 3) int64
    source : (V,) int64
        Original vertex in the file of each vertex.
    material : GltfMaterial, UsdMaterial, trimesh material or None
    color : (r, g, b), (r, g, b, opacity) or None
        Linear color that multiplies the material; None if the file has none.
    colors : (V, 3) or (V, 4) float32 or None
        Colors by vertex where they differ; then no two triangles share a vertex.
    tangents : (V, 4) float64 or None
        As in `Mesh`.
    uvs2 : (V, 2) float32 or None
        As in `Shape`.
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    uvs: NDArray[np.float32]
    triangles: NDArray[np.int64]
    source: NDArray[np.int64]
    material: Any
    color: tuple[float, ...] | None = None
    colors: NDArray[np.float32] | None = None
    tangents: NDArray[np.float64] | None = None
    uvs2: NDArray[np.float32] | None = None

    def taken(self, source: NDArray[np.int64], triangles: NDArray[np.int64]) -> Part:
        """Return the part with new triangles, whose vertices (W,) are copies of `source`."""
        return replace(
            self,
            positions=self.positions[source],
            normals=self.normals[source],
            uvs=self.uvs[source],
            triangles=triangles,
            source=self.source[source],
            colors=None if self.colors is None else self.colors[source],
            tangents=None if self.tangents is None else self.tangents[source],
            uvs2=None if self.uvs2 is None else self.uvs2[source],
        )


def load_mesh(path: Path, material: Material | None = None, within: Path | None = None) -> Mesh:
    """Load a mesh with its materials, or with one material for all of it.

    Geometries of different materials are never merged. Missing normals become flat for glTF, and
    smooth up to a crease angle for other formats (`creases.py`). Degenerate and non-finite
    triangles are removed. Skins of glTF files follow their joints at rest, without an animation
    (Khronos glTF 2.0, section 3.7.3.3). USD files are taken to metres with +Y up. Vertex colors
    become a texture. A warning is logged for each missing or unsupported property of the file's
    materials that would change the look much.

    Parameters
    ----------
    path : Path
        .ply, .obj, .stl, .gltf, .glb, .usd, .usda, .usdc or .usdz.
    material : Material or None
        Replaces the materials of the file.
    within : Path or None
        Folder that must hold all files of the mesh, with links resolved; by default the mesh's own.

    Raises
    ------
    FormatError
        The file is missing, damaged, too large or without triangles, or a referenced file is
        missing or outside the folder.
    """
    file = MeshFile(path, within)
    dropped = file.unread_parts()
    with decoding(path, "cut off or damaged mesh file"), np.errstate(all="ignore"):
        colored = material is None
        if file.gltf is not None or file.usd is not None:
            shapes_of = resting_shapes if file.usd is None else usd_shapes
            placed = shapes_of(file, colored=colored)
            parts = [part_of(shape, matrices, dropped) for matrices, shape in placed]
        else:
            shapes = trimesh_shapes(file, dropped, colored=colored)
            parts = [part_of(shape, np.eye(4)[None, :3], dropped) for shape in shapes]
        if file.suffix == ".stl":
            parts = [_welded(part) for part in parts]
        mesh = joined(file, parts, material, dropped)
    if mesh.triangles.shape[0] == 0:
        raise FormatError(f"{path}: holds no triangles")
    return mesh


def _welded(part: Part) -> Part:
    """Merge the vertices of equal position; STL has one for each triangle at a position."""
    number = same_position(part.positions)
    _, first = np.unique(number, return_index=True)
    return part.taken(first, number[part.triangles])


def part_of(shape: Shape, matrices: NDArray[np.float64], dropped: list[str]) -> Part:
    """Return a shape, transformed by matrices: (1, 3, 4) float64 for all vertices, or (V, 3, 4)."""
    positions, normals, triangles = shape.positions, shape.normals, shape.triangles
    if not np.allclose(matrices, np.eye(4)[:3]):
        positions, normals = moved(positions, normals, matrices)
        mirrored = np.broadcast_to(np.linalg.det(matrices[:, :, :3]) < 0.0, len(positions))
        turned = mirrored[triangles[:, :1]]
        triangles = np.where(turned, triangles[:, ::-1], triangles)
    kept = _usable_triangles(positions, triangles)
    if removed := len(triangles) - len(kept):
        _note(dropped, f"{removed} degenerate or non-finite triangles")
    positions = np.nan_to_num(positions, posinf=0.0, neginf=0.0)
    source = np.arange(len(positions))
    part = Part(positions, normals, shape.uvs.copy(), triangles[kept], source, shape.material)
    part.uvs2 = shape.uvs2
    if shape.bumpy:
        tangents = None if shape.tangents is None else moved_tangents(shape.tangents, matrices)
        part = _bumpy(part, tangents, shape.tangent_place)
    return part if shape.colors is None else _colored(part, shape.colors[kept], dropped)


def _bumpy(part: Part, tangents: NDArray[np.float64] | None, place: Place | None) -> Part:
    """Return a part with tangents, and with flat normals where it has no others.

    `place` is of the normal map, which tangents that are not given follow.
    """
    usable = have_normals(part.normals)
    if tangents is not None and usable.all() and np.isfinite(tangents).all():
        return replace(part, tangents=tangents)
    flat = np.ones(len(part.triangles), np.bool_)
    source, normals, triangles = with_normals(part.positions, part.normals, part.triangles, flat)
    part = replace(part.taken(source, triangles), normals=normals)
    uvs = part.uvs if place is None else place.coordinates(part.uvs, part.uvs2)
    source, tangents, triangles = with_tangents(part.positions, normals, uvs, triangles)
    return replace(part.taken(source, triangles), tangents=tangents)


def _colored(part: Part, colors: NDArray[np.float32], dropped: list[str]) -> Part:
    """Return a part with the colors (F, 3, 3) or (F, 3, 4) of its triangles' corners."""
    flat = colors.reshape(-1, colors.shape[2])
    varied = bool((flat != flat[:1]).any())
    if varied and not has_texture(part.material):
        count = len(part.triangles)
        divided = part.taken(part.triangles.ravel(), np.arange(3 * count).reshape(-1, 3))
        return replace(divided, colors=flat)
    if varied:
        _note(dropped, "colors of vertices below a texture; their mean is used")
    mean = flat.mean(axis=0, dtype=np.float64) if len(flat) else np.ones(flat.shape[1])
    return replace(part, color=tuple(map(float, mean)))


def joined(
    file: MeshFile, parts: list[Part], override: Material | None, dropped: list[str]
) -> Mesh:
    """Merge all parts into one mesh, with a material index per triangle."""
    if not parts:
        raise FormatError(f"{file.path}: holds no triangles")
    warnings: list[str] = []
    if override is not None:
        materials, index = [override], [0] * len(parts)
    else:
        materials, index = _materials(file, parts, dropped)
        warnings = file.warnings()
    ends = np.cumsum([len(part.positions) for part in parts])
    placed = zip(parts, ends, strict=True)
    triangles = np.concatenate([part.triangles + end - len(part.positions) for part, end in placed])
    positions = np.concatenate([part.positions for part in parts])
    normals = np.concatenate([part.normals for part in parts])
    uvs = np.concatenate([part.uvs for part in parts])
    tangents = None
    if any(part.tangents is not None for part in parts):
        none = [np.zeros((len(part.positions), 4)) for part in parts]
        given = [part.tangents for part in parts]
        tangents = np.concatenate([n if t is None else t for t, n in zip(given, none, strict=True)])
    uvs2 = None
    if any(place is not None and place.second for one in materials for place in one.map_places):
        given2 = [np.zeros_like(part.uvs) if part.uvs2 is None else part.uvs2 for part in parts]
        uvs2 = np.concatenate(given2)
    indices = np.repeat(index, [len(part.triangles) for part in parts])
    flat = np.full(len(triangles), file.gltf is not None)
    source, normals, triangles = with_normals(positions, normals, triangles, flat)
    mesh = Mesh(
        positions=positions[source].astype(np.float32),
        normals=normals.astype(np.float32),
        uvs=uvs[source].astype(np.float32),
        triangles=np.ascontiguousarray(triangles, np.int32),
        material_index=indices.astype(np.int32),
        materials=tuple(materials),
        dropped=tuple(dict.fromkeys(dropped)),
        warnings=tuple(warnings),
        tangents=None if tangents is None else tangents[source].astype(np.float32),
        uvs2=None if uvs2 is None else uvs2[source],
    )
    mesh = with_solids(mesh)
    for line in mesh.warnings:
        LOG.warning("%s: %s", file.path, line)
    return mesh


def _materials(
    file: MeshFile, parts: list[Part], dropped: list[str]
) -> tuple[list[Material], list[int]]:
    """Return the materials of parts, and the index of each part's material.

    Parts with vertex colors get texture coordinates into a texture that they share with the other
    parts of the same material.
    """
    groups: dict[tuple[int, Any, bool], list[int]] = {}
    for number, part in enumerate(parts):
        key = (id(part.material), part.color, part.colors is not None)
        groups.setdefault(key, []).append(number)
    textures = Textures(file.path)
    materials: list[Material] = []
    index = [0] * len(parts)
    for (_, color, varied), numbers in groups.items():
        members = [parts[number] for number in numbers]
        material = convert_material(members[0].material, file, textures, dropped)
        if varied:
            texture = _shared_colors(members)
            textures.count(texture.shape[0] * texture.shape[1])
            material = colored(tinted(material, (1.0, 1.0, 1.0)), texture)
        for number in numbers:
            index[number] = len(materials)
        materials.append(tinted(material, color))
    return materials, index


def _shared_colors(parts: list[Part]) -> NDArray[np.float32]:
    """Return a texture with the colors of parts, and set the parts' texture coordinates."""
    corners = [part.positions[part.triangles] for part in parts]
    colors = [part.colors[part.triangles] for part in parts if part.colors is not None]
    centers = np.concatenate([each.mean(axis=1) for each in corners])
    texture, uvs = color_texture(centers, np.concatenate(colors))
    first = 0
    for part in parts:
        count = len(part.triangles)
        part.uvs[part.triangles] = uvs[first : first + count]
        first += count
    return texture


def _usable_triangles(
    positions: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the indices of triangles with finite corners and an area above rounding noise."""
    corners = positions[triangles]
    with np.errstate(invalid="ignore"):
        finite: NDArray[np.bool_] = np.all(np.abs(corners) < 1e18, axis=(1, 2))
    corners = np.where(finite[:, None, None], corners, 0.0)
    edges = corners - np.roll(corners, 1, axis=1)
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest = np.einsum("fij,fij->fi", edges, edges).max(axis=1, initial=0.0)
    return np.flatnonzero(finite & (area > 1e-9 * longest) & (longest > 0.0))


def _note(dropped: list[str], phrase: str) -> None:
    if phrase not in dropped:
        dropped.append(phrase)
