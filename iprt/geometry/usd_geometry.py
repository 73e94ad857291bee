"""Triangles of the prims of a USD stage.

Specification: the schemas of UsdGeom in OpenUSD.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdShade

from iprt.geometry.creases import same_position
from iprt.geometry.place import IDENTITY, Coefficients
from iprt.geometry.usd_data import UsdMaterial

Float = NDArray[np.float64]
Ints = NDArray[np.int64]

COORDINATES = ("st", "UVMap", "map1", "uv")
"""Usual names of texture coordinates, for meshes whose material does not tell."""
SOLIDS = ("Sphere", "Cube", "Cylinder", "Cone", "Capsule", "Plane")
PER_VERTEX = ("vertex", "varying", "constant")
_TO_AXIS = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}
"""Order of coordinates that takes a solid along Z to each axis."""


@dataclass(frozen=True)
class Geometry:
    """Triangles with one material.

    Attributes
    ----------
    positions, normals : (V, 3) float64
        In the units and axes of the prim; normals are NaN where it has none.
    uvs : (V, 2) float32
        v up.
    triangles : (F, 3) int64
        Counter-clockwise seen from outside.
    colors : (F, 3, 3) float32 or None
        Linear RGB from 0 to 1 by triangle and corner; None without colors.
    uvs2 : (V, 2) float32 or None
        Like `uvs`, if the material has a second set.
    """

    positions: Float
    normals: Float
    uvs: NDArray[np.float32]
    triangles: Ints
    colors: NDArray[np.float32] | None = None
    uvs2: NDArray[np.float32] | None = None

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays by name."""
        return {name: array for name, array in vars(self).items() if array is not None}

    def part(self, chosen: NDArray[np.bool_]) -> Geometry:
        """Return some of the triangles (F,), with their vertices only."""
        used, index = np.unique(self.triangles[chosen], return_inverse=True)
        return Geometry(
            self.positions[used],
            self.normals[used],
            self.uvs[used],
            index.reshape(-1, 3),
            None if self.colors is None else self.colors[chosen],
            None if self.uvs2 is None else self.uvs2[used],
        )


class Corners:
    """The corners of the polygons of a mesh prim, cut into triangles by fans.

    Attributes
    ----------
    points : (V, 3) float64
    vertex : (C,) int64
        Vertex of each corner of a polygon.
    face : (C,) int64
        Polygon of each corner.
    triangles : (F, 3) int64
        Corners of triangles.
    of_face : (F,) int64
        Polygon of each triangle.

    Raises
    ------
    ValueError
        Counts and indices of the mesh contradict each other.
    """

    def __init__(self, mesh: Any, time: Any) -> None:
        def given(attribute: Any, columns: int, dtype: Any) -> NDArray[Any]:
            value = attribute.Get(time)
            return np.array([] if value is None else value, dtype).reshape(-1, columns)

        self.points = given(mesh.GetPointsAttr(), 3, np.float64)
        counts = given(mesh.GetFaceVertexCountsAttr(), 1, np.int64).ravel()
        self.vertex = given(mesh.GetFaceVertexIndicesAttr(), 1, np.int64).ravel()
        if counts.min(initial=0) < 0 or counts.sum() != len(self.vertex):
            raise ValueError(f"{mesh.GetPath()}: its faces do not match its indices")
        if self.vertex.min(initial=0) < 0 or self.vertex.max(initial=-1) >= len(self.points):
            raise ValueError(f"{mesh.GetPath()}: a face refers to a vertex that does not exist")
        self.face = np.repeat(np.arange(len(counts)), counts)
        fans = np.maximum(counts - 2, 0)
        self.of_face = np.repeat(np.arange(len(counts)), fans)
        step = np.arange(fans.sum()) - np.repeat(np.cumsum(fans) - fans, fans)
        start = (np.cumsum(counts) - counts)[self.of_face]
        self.triangles = np.stack([start, start + step + 1, start + step + 2], axis=1)
        if mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
            self.triangles = self.triangles[:, ::-1]
        holes = given(mesh.GetHoleIndicesAttr(), 1, np.int64).ravel()
        kept = ~np.isin(self.of_face, holes)
        self.triangles, self.of_face = self.triangles[kept], self.of_face[kept]

    def rows(self, values: NDArray[Any], interpolation: str) -> NDArray[Any] | None:
        """Return values (N, columns) by corner (C, columns), or None if N does not fit."""
        index = {
            "constant": np.zeros(len(self.vertex), np.int64),
            "uniform": self.face,
            "vertex": self.vertex,
            "varying": self.vertex,
            "faceVarying": np.arange(len(self.vertex)),
        }.get(interpolation)
        if index is None or len(values) <= index.max(initial=-1):
            return None
        return np.asarray(values[index])


@dataclass(frozen=True)
class Needs:
    """The properties of a material that the arrays of a mesh depend on.

    Attributes
    ----------
    coordinates : str or None
        Name of the texture coordinates; None without textures.
    matrix : Coefficients
        Map of the coordinates.
    colors : bool
        True if it shows the primvar `displayColor`.
    second : str or None
        Name of the second set of texture coordinates; None without one.
    """

    coordinates: str | None = None
    matrix: Coefficients = IDENTITY
    colors: bool = True
    second: str | None = None

    @classmethod
    def of(cls, material: UsdMaterial | None) -> Needs:
        """Return the needs of a material; None: prims without one show their colors."""
        if material is None:
            return cls()
        textures = material.textures()
        if not textures:
            return cls(colors=material.vertex_colors)
        first = textures[0]
        return cls(first.coordinates, first.matrix, material.vertex_colors, material.second)


def mesh_geometry(
    prim: Any, time: Any, needs: Needs, unread: dict[str, None]
) -> tuple[Geometry, Ints]:
    """Return the triangles of a mesh prim, and the polygon of each; note unread parts.

    Vertices are divided where normals or texture coordinates differ by face.

    Raises
    ------
    ValueError
        As `Corners`.
    """
    mesh = UsdGeom.Mesh(prim)
    corners = Corners(mesh, time)
    normals, smooth = _normals(mesh, corners, time, unread)
    if mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none and np.isnan(normals).any():
        unread["subdivision; meshes are shown as stored"] = None
    uvs, continuous = _coordinates(prim, corners, needs.coordinates, needs.matrix, time, unread)
    rows = [corners.vertex[:, None], np.nan_to_num(normals), uvs]
    uvs2 = None
    if needs.second is not None:
        uvs2, both = _coordinates(prim, corners, needs.second, IDENTITY, time, unread)
        continuous = continuous and both
        rows.append(uvs2)
    colors = _colors(prim, corners, time, unread) if needs.colors else None
    if smooth and continuous:
        vertex = corners.vertex
        where = _places(vertex, len(corners.points) if len(vertex) else 0)
    else:
        vertex = same_position(np.concatenate(rows, axis=1))
        where = _places(vertex, vertex.max(initial=-1) + 1)
    geometry = Geometry(
        corners.points[corners.vertex[where]],
        normals[where],
        uvs[where].astype(np.float32),
        vertex[corners.triangles],
        None if colors is None else colors[corners.triangles],
        None if uvs2 is None else uvs2[where].astype(np.float32),
    )
    return geometry, corners.of_face


def _places(numbers: Ints, count: int) -> Ints:
    """Return an index (count,) at which each number is found; 0 for numbers that are not there."""
    where = np.zeros(count, np.int64)
    where[numbers] = np.arange(len(numbers))
    return where


def _normals(mesh: Any, corners: Corners, time: Any, unread: dict[str, None]) -> tuple[Float, bool]:
    """Return normals by corner (C, 3), NaN without any, and if they are the same at a vertex."""
    none = np.full((len(corners.vertex), 3), np.nan)
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    if primvar and primvar.HasValue():
        values, interpolation = primvar.ComputeFlattened(time), primvar.GetInterpolation()
    else:
        values = mesh.GetNormalsAttr().Get(time)
        interpolation = mesh.GetNormalsInterpolation()
    if values is None or not len(values):
        return none, True
    rows = corners.rows(np.array(values, np.float64).reshape(-1, 3), interpolation)
    if rows is None:
        unread["normals that do not match their mesh"] = None
        return none, True
    return rows, interpolation in PER_VERTEX


def _coordinates(
    prim: Any,
    corners: Corners,
    wanted: str | None,
    place: Coefficients,
    time: Any,
    unread: dict[str, None],
) -> tuple[Float, bool]:
    """Return texture coordinates by corner (C, 2), and if they are the same at a vertex.

    The primvar `wanted`, or else one of a usual name, is mapped by `place`.
    """
    for name in COORDINATES if wanted is None else (wanted, *COORDINATES):
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        values = primvar.ComputeFlattened(time) if primvar and primvar.HasValue() else None
        if values is None or not len(values):
            continue
        array = np.array(values, np.float64)
        if array.ndim != 2 or array.shape[1] < 2:
            continue
        rows = corners.rows(array[:, :2], primvar.GetInterpolation())
        if rows is None:
            unread["texture coordinates that do not match their mesh"] = None
            continue
        matrix = np.array(place)
        rows = np.nan_to_num(rows) @ matrix[:, :2].T + matrix[:, 2]
        return rows, primvar.GetInterpolation() in PER_VERTEX
    return np.zeros((len(corners.vertex), 2)), True


def _colors(
    prim: Any, corners: Corners, time: Any, unread: dict[str, None]
) -> NDArray[np.float32] | None:
    """Return linear colors by corner (C, 3), from 0 to 1; None without any."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
    values = primvar.ComputeFlattened(time) if primvar and primvar.HasValue() else None
    if values is None or not len(values):
        return None
    rows = corners.rows(np.array(values, np.float64).reshape(-1, 3), primvar.GetInterpolation())
    if rows is None:
        unread["colors that do not match their mesh"] = None
        return None
    return np.asarray(np.clip(np.nan_to_num(rows), 0.0, 1.0), np.float32)


def solid_geometry(prim: Any, time: Any, *, colored: bool) -> Geometry:
    """Return the triangles of a sphere, cube, cylinder, cone, capsule or plane."""
    import trimesh

    def given(name: str) -> Any:
        return prim.GetAttribute(name).Get(time)

    kind = prim.GetTypeName()
    if kind == "Sphere":
        made = trimesh.creation.icosphere(4, given("radius"))
    elif kind == "Cube":
        made = trimesh.creation.box((given("size"),) * 3)
    elif kind == "Cylinder":
        made = trimesh.creation.cylinder(given("radius"), given("height"), sections=64)
    elif kind == "Cone":
        made = trimesh.creation.cone(given("radius"), given("height"), sections=64)
        made.apply_translation((0.0, 0.0, -0.5 * given("height")))
    elif kind == "Capsule":
        made = trimesh.creation.capsule(given("height"), given("radius"), count=(32, 64))
        made.apply_translation(-made.bounds.mean(axis=0))
    else:
        x, y = 0.5 * given("width"), 0.5 * given("length")
        # The width lies along X, or Z if the axis is X.
        x, y = (x, y) if given("axis") == "Z" else (y, x)
        made = trimesh.Trimesh([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], [[0, 1, 2, 3]])
    order = _TO_AXIS["Z" if kind in ("Sphere", "Cube") else given("axis")]
    positions, triangles = np.array(made.vertices)[:, order], np.array(made.faces, np.int64)
    color = UsdGeom.Gprim(prim).GetDisplayColorAttr().Get(time) if colored else None
    colors = None
    if color:
        one = np.clip(np.array(color[0], np.float32), 0.0, 1.0)
        colors = np.broadcast_to(one, (len(triangles), 3, 3)).copy()
    nothing = np.full(positions.shape, np.nan)
    return Geometry(
        positions, nothing, np.zeros((len(positions), 2), np.float32), triangles, colors
    )


def subsets(prim: Any, time: Any) -> Iterator[tuple[Any, Ints]]:
    """Yield the subsets of a mesh that have materials of their own, with their polygons."""
    for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        if subset.GetElementTypeAttr().Get(time) == UsdGeom.Tokens.face:
            faces = subset.GetIndicesAttr().Get(time)
            yield subset.GetPrim(), np.array([] if faces is None else faces, np.int64)
