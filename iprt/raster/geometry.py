"""The triangles of all instances on the graphics device, in world space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.geometry.material import first_variants, table_rows
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.mesh import (
    Instance,
    Mesh,
    cofactors,
    motion_between,
    row_owners,
    transformed,
)
from iprt.geometry.tangents import moved_tangents
from iprt.raster.images import images_of
from iprt.raster.region import box_corners
from iprt.raster.targets import texture_bytes

Float = NDArray[np.float64]

_TRIANGLES_WIDTH = 2048
_VERTICES_WIDTH = 2048
"""Size in texels; `glsl/mesh.glsl` has their logarithms. A vertex takes two texels."""

_TABLE_WIDTH = 6
"""Texels per material."""

_VERTICES_PER_ROW = _VERTICES_WIDTH // 2
_CORNERS_BYTES = 3 * 3 * 4
_CURVE_BITS = 6
_MAX_TRIANGLES = 1 << 24
"""Triangle numbers are stored in a float32 image, which is exact up to this number."""


@dataclass
class Part:
    """One instance's part of the buffers.

    Attributes
    ----------
    index : int
        Index of the instance.
    vertex_row : int
        First row in the vertex texture; every instance starts a row, so that it can be rewritten
        alone.
    triangles : (F, 3) int32
        Drawn triangles of the mesh.
    materials : slice
        Range of its materials in the materials of all instances.
    object_box : (8, 3) float64
        Corners of the bounding box, object space.
    displacement : (V, 3) float64 or None
        Offsets to the previous frame's vertices, object space; None without deformation.
    to_world, previous : (4, 4) float64
        Transforms of this frame and of the previous one.
    """

    instance: Instance
    index: int
    vertex_row: int
    first_triangle: int
    triangles: NDArray[np.int32]
    materials: slice
    object_box: Float
    to_world: Float
    previous: Float
    displacement: Float | None = None

    @property
    def vertex_rows(self) -> int:
        """Number of rows in the vertex texture."""
        return _rows(len(self.instance.mesh.positions), _VERTICES_PER_ROW)

    @property
    def mirrored(self) -> bool:
        """True if the transform turns counter-clockwise triangles clockwise."""
        return float(np.linalg.det(self.to_world[:3, :3])) < 0.0

    @property
    def corners(self) -> Float:
        """(8, 3) world-space corners of a box around the part, for `region.box_rects`."""
        return transformed(self.to_world, self.object_box)

    @property
    def motion(self) -> Float:
        """(3, 4) affine map of this frame's displaced world points to the previous frame."""
        return motion_between(self.previous, self.to_world)

    def move(self, instance: Instance) -> bool:
        """Start a frame; return True if the vertices have moved in world space."""
        before, self.instance = self.instance.mesh, instance
        self.previous, self.to_world = self.to_world, _affine(instance.name, instance.to_world)
        self.displacement = None
        if instance.mesh is not before and instance.mesh.deforms:
            self.displacement = before.positions.astype(np.float64) - instance.mesh.positions
            self.object_box = _box_of(instance.mesh, self.triangles)
        return self.displacement is not None or not np.array_equal(self.to_world, self.previous)


class WorldGeometry:
    """Vertices, triangles and materials of all instances in device memory.

    Vertices are transformed on the host in double precision when an instance moves. All passes and
    both projections therefore see the same float32 triangles.

    Attributes
    ----------
    parts : tuple of Part
        Instances with triangles.
    materials : tuple of Material
        Of all instances.
    material_object : (M,) int32
        Index of the instance that each material of their `table_rows` belongs to.
    positions : moderngl.Buffer
        World-space corners, three per triangle. Unindexed drawing numbers the triangles at less
        cost than gl_PrimitiveID on software renderers.
    triangles, vertices, table : moderngl.Texture
        See `glsl/mesh.glsl` and `glsl/shade.frag`.
    displacements, tangents, uvs2 : moderngl.Texture or None
        See the same files; None if no mesh deforms, without normal maps, or if all maps lie where
        the colors do.
    images : dict of int to dict of str to moderngl.Texture
        By material, if it is textured: its textures, by their names in `glsl/shade.frag`.
    first_variants : list of int
        `first_variants` of the materials.
    """

    def __init__(self, context: moderngl.Context, instances: Sequence[Instance]) -> None:
        self.parts, table, rows = _lay_out(instances)
        self.materials = tuple(m for instance in instances for m in instance.mesh.materials)
        self.material_object = row_owners(instances)
        self.first_variants = first_variants(self.materials)
        self.positions = context.buffer(reserve=max(len(table), 1) * _CORNERS_BYTES)
        self.triangles = context.texture(
            (_TRIANGLES_WIDTH, max(_rows(len(table), _TRIANGLES_WIDTH), 1)), 4, dtype="i4"
        )
        self.triangles.write(_padded(table, _TRIANGLES_WIDTH))
        self.vertices = context.texture((_VERTICES_WIDTH, max(rows, 1)), 4, dtype="f4")
        self.displacements: moderngl.Texture | None = None
        if any(instance.mesh.deforms for instance in instances):
            size = (_VERTICES_PER_ROW, max(rows, 1))
            self.displacements = context.texture(size, 4, bytes(16 * size[0] * size[1]), dtype="f4")
        self.tangents: moderngl.Texture | None = None
        needs = MaterialNeeds.of(self.materials)
        if needs.normal_maps:
            size = (_VERTICES_PER_ROW, max(rows, 1))
            self.tangents = context.texture(size, 4, dtype="f4")
        self.uvs2: moderngl.Texture | None = None
        if needs.texture_places:
            self.uvs2 = context.texture((_VERTICES_PER_ROW, max(rows, 1)), 2, dtype="f4")
        self.table = context.texture(
            (_TABLE_WIDTH, max(len(self.material_object), 1)), 4, dtype="f4"
        )
        self.images = {
            index: images_of(context, material, variants=needs.variants)
            for index, material in enumerate(self.materials)
            if material.textured
        }
        for part in self.parts:
            self._upload(part)
        self._upload_table()

    @property
    def nbytes(self) -> tuple[int, int]:
        """Bytes of the triangle data, and of the textures with their mipmaps."""
        tables = [
            self.triangles,
            self.vertices,
            self.table,
            self.displacements,
            self.tangents,
            self.uvs2,
        ]
        triangles = sum(texture_bytes(table) for table in tables if table is not None)
        textures = [texture for images in self.images.values() for texture in images.values()]
        images = sum(map(texture_bytes, textures))
        return self.positions.size + triangles, images * 4 // 3

    def move(self, instances: Sequence[Instance]) -> None:
        """Start a frame: `instances` become current, and the old transforms previous."""
        for part in self.parts:
            if part.move(instances[part.index]):
                self._upload(part)
            if self.displacements is not None and part.instance.mesh.deforms:
                self._upload_displacements(self.displacements, part)
        self._upload_table()

    def _upload(self, part: Part) -> None:
        """Upload one instance's world-space vertices."""
        mesh = part.instance.mesh
        side = -1.0 if part.mirrored else 1.0
        normals = mesh.normals @ (side * cofactors(part.to_world[:3, :3])).T
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        texels = np.zeros((len(mesh.positions), 2, 4), np.float32)
        with np.errstate(invalid="ignore", over="ignore"):  # vertices of undrawn triangles
            texels[:, 0, :3] = transformed(part.to_world, mesh.positions)
        corners = texels[:, 0, :3][part.triangles]
        self.positions.write(corners, offset=part.first_triangle * _CORNERS_BYTES)
        np.divide(normals, length, out=texels[:, 1, :3], where=length > 0.0, casting="same_kind")
        texels[:, :, 3] = mesh.uvs
        self.vertices.write(
            _padded(texels, _VERTICES_PER_ROW),
            viewport=(0, part.vertex_row, _VERTICES_WIDTH, part.vertex_rows),
        )
        if self.tangents is not None:
            self._upload_tangents(self.tangents, part)
        if self.uvs2 is not None:
            texels2 = np.zeros_like(mesh.uvs) if mesh.uvs2 is None else mesh.uvs2
            self.uvs2.write(
                _padded(texels2, _VERTICES_PER_ROW),
                viewport=(0, part.vertex_row, _VERTICES_PER_ROW, part.vertex_rows),
            )

    def _upload_tangents(self, texture: moderngl.Texture, part: Part) -> None:
        """Upload one instance's world-space tangents; 0 without."""
        mesh = part.instance.mesh
        texels = np.zeros((len(mesh.positions), 4), np.float32)
        if mesh.tangents is not None:
            texels[:] = moved_tangents(mesh.tangents, part.to_world[None, :3])
        texture.write(
            _padded(texels, _VERTICES_PER_ROW),
            viewport=(0, part.vertex_row, _VERTICES_PER_ROW, part.vertex_rows),
        )

    def _upload_displacements(self, texture: moderngl.Texture, part: Part) -> None:
        """Upload the world-space offsets to one instance's vertices before its motion."""
        texels = np.zeros((len(part.instance.mesh.positions), 4), np.float32)
        if part.displacement is not None:
            texels[:, :3] = part.displacement @ part.to_world[:3, :3].T
        texture.write(
            _padded(texels, _VERTICES_PER_ROW),
            viewport=(0, part.vertex_row, _VERTICES_PER_ROW, part.vertex_rows),
        )

    def _upload_table(self) -> None:
        table = np.zeros((max(len(self.material_object), 1), _TABLE_WIDTH, 4), np.float32)
        for row, material in zip(table, table_rows(self.materials), strict=False):
            row[0, :3] = material.albedo
            row[4, :2] = material.metallic, material.alpha
            row[5, :3] = material.emission
        for part in self.parts:
            table[: len(self.material_object)][self.material_object == part.index, 1:4] = (
                part.motion
            )
        self.table.write(table)


def _lay_out(instances: Sequence[Instance]) -> tuple[tuple[Part, ...], NDArray[np.int32], int]:
    """Lay out the buffers.

    Returns
    -------
    parts : tuple of Part
    table : (F, 4) int32
        Three vertex numbers and the material of each triangle.
    rows : int
        Rows of the vertex texture.
    """
    parts: list[Part] = []
    table = [np.zeros((0, 4), np.int32)]
    first_material = row = count = 0
    for index, instance in enumerate(instances):
        mesh = instance.mesh
        materials = slice(first_material, first_material + len(mesh.materials))
        first_material = materials.stop
        matrix = _affine(instance.name, instance.to_world)
        order = _drawing_order(mesh)
        if len(order) == 0:
            continue
        triangles = mesh.triangles[order]
        box = _box_of(mesh, triangles)
        parts.append(Part(instance, index, row, count, triangles, materials, box, matrix, matrix))
        numbers = triangles + row * _VERTICES_PER_ROW
        material = mesh.material_index[order, None] + materials.start
        table.append(np.concatenate([numbers, material], axis=1).astype(np.int32))
        count += len(triangles)
        row += parts[-1].vertex_rows
    if max(count, row * _VERTICES_PER_ROW) > _MAX_TRIANGLES:
        raise SceneError(
            f"the objects have {count} triangles and {row * _VERTICES_PER_ROW} vertices, more than "
            f"{_MAX_TRIANGLES}: simplify them"
        )
    return tuple(parts), np.concatenate(table), row


def _box_of(mesh: Mesh, triangles: NDArray[np.int32]) -> Float:
    """Return the (8, 3) corners of a box around triangles of a mesh, object space."""
    used = mesh.positions[triangles.ravel()].astype(np.float64)
    return box_corners(used.min(axis=0), used.max(axis=0))


def _drawing_order(mesh: Mesh) -> NDArray[np.int64]:
    """Return the triangles with finite corners, sorted along a Morton curve through their centres.

    Neighbours in the buffer are then neighbours in the image. This accounts for a third of the
    speed difference on a software renderer.
    """
    (drawable,) = np.nonzero(np.isfinite(mesh.positions[mesh.triangles]).all(axis=(1, 2)))
    if len(drawable) == 0:
        return drawable
    centres = mesh.positions[mesh.triangles[drawable]].mean(axis=1, dtype=np.float64)
    low = centres.min(axis=0)
    extent = max(float((centres.max(axis=0) - low).max()), np.finfo(np.float64).tiny)
    cells = np.minimum((centres - low) / extent * (1 << _CURVE_BITS), (1 << _CURVE_BITS) - 1)
    bits = cells.astype(np.int64)[:, :, None] >> np.arange(_CURVE_BITS) & 1
    code = (bits << (3 * np.arange(_CURVE_BITS) + np.arange(3)[:, None])).sum(axis=(1, 2))
    return drawable[np.argsort(code, kind="stable")]


def _affine(name: str, matrix: NDArray[np.floating]) -> Float:
    checked = np.array(matrix, np.float64)
    if checked.shape != (4, 4) or not np.isfinite(checked).all():
        raise SceneError(f"object {name}: to_world must be 4x4 finite numbers, got {matrix!r}")
    return checked


def _rows(count: int, width: int) -> int:
    return -(-count // width)


def _padded(array: NDArray[np.generic], width: int) -> bytes:
    """Return the bytes of `array`, zero-padded to whole rows of `width` items, at least one row."""
    missing = max(_rows(len(array), width), 1) * width - len(array)
    return array.tobytes() + bytes(missing * array.itemsize * int(np.prod(array.shape[1:])))
