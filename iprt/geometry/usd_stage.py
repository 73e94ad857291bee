"""The prims of a USD stage that are read, placed in metres with +Y up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom

from iprt.files.message_text import counted, printable
from iprt.files.safe_reading import MAX_TRIANGLES, MAX_VERTICES
from iprt.geometry.usd_data import Placed
from iprt.geometry.usd_geometry import (
    SOLIDS,
    Geometry,
    Needs,
    mesh_geometry,
    solid_geometry,
    subsets,
)
from iprt.geometry.usd_layers import Layers
from iprt.geometry.usd_shading import Materials, stage_time

MAX_PRIMS = 2**17
"""Limit for prims and instances, each of which is visited in Python."""
Key = tuple[str, tuple[int | None, ...]]


class StageReader:
    """Reader of the geometry of a stage.

    Attributes
    ----------
    geometries : list of Geometry
    placed : list of Placed
    matrices : list of (4, 4) float64
        Transforms of `placed` to metres, +Y up.
    unread : dict of str to None
        Phrases in the order in which they were found.

    Raises
    ------
    ValueError
        The stage is damaged or too large.
    """

    def __init__(self, layers: Layers) -> None:
        self._stage = layers.stage
        self._time = stage_time(self._stage)
        self._cache = UsdGeom.XformCache(self._time)
        self._to_metres = _to_metres(self._stage)
        self.materials = Materials(layers, self._time)
        self.geometries: list[Geometry] = []
        self.placed: list[Placed] = []
        self.matrices: list[NDArray[np.float64]] = []
        self.unread: dict[str, None] = {}
        self._others: Counter[str] = Counter()
        self._read: dict[Key, list[Placed]] = {}
        self._visited = self._triangles = self._vertices = 0
        self._visit(self._stage.GetPseudoRoot(), None, Gf.Matrix4d(1.0))
        for name, count in self._others.items():
            self.unread[f"{name} ({count})"] = None
        if errors := self._stage.GetCompositionErrors():
            self.unread[f"references that lead nowhere ({len(errors)})"] = None
        if layers.has_clips:
            self.unread["value clips"] = None

    def _visit(self, root: Any, origin: Any, base: Any) -> None:
        """Read the prims below `root`, which are placed by `base` relative to the prim `origin`."""
        prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
        for prim in prims:
            self._count()
            if not self._is_shown(prim):
                prims.PruneChildren()
                continue
            if origin is None:
                to_world = self._cache.GetLocalToWorldTransform(prim)
            else:
                to_world = self._cache.ComputeRelativeTransform(prim, origin)[0] * base
            kind = prim.GetTypeName()
            if kind == "PointInstancer":
                prims.PruneChildren()
                self._instances(UsdGeom.PointInstancer(prim), to_world)
            elif kind == "Mesh" or kind in SOLIDS:
                self._add(prim, to_world)
            else:
                self._name(prim)

    def _count(self, more: int = 1) -> None:
        self._visited += more
        if self._visited > MAX_PRIMS:
            raise ValueError(f"more than {counted(MAX_PRIMS, 'prim')} and instances")

    def _is_shown(self, prim: Any) -> bool:
        """Return False if a prim is invisible, or serves another purpose than the final picture."""
        imageable = UsdGeom.Imageable(prim)
        if not imageable:
            return True
        if imageable.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
            return False
        other = (UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide)
        return imageable.GetPurposeAttr().Get() not in other

    def _instances(self, instancer: Any, to_world: Any) -> None:
        """Read the prototypes of a point instancer, once for each instance."""
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        numbers = instancer.GetProtoIndicesAttr().Get(self._time)
        places = instancer.ComputeInstanceTransformsAtTime(
            self._time,
            self._time,
            UsdGeom.PointInstancer.IncludeProtoXform,
            UsdGeom.PointInstancer.IgnoreMask,
        )
        shown = instancer.ComputeMaskAtTime(self._time) or [True] * len(places)
        for number, place, is_shown in zip(numbers or (), places, shown, strict=False):
            self._count()
            prototype = None
            if 0 <= number < len(targets):
                prototype = self._stage.GetPrimAtPath(targets[number])
            if is_shown and prototype:
                self._visit(prototype, prototype, place * to_world)

    def _add(self, prim: Any, to_world: Any) -> None:
        if prim.HasAPI("SkelBindingAPI"):
            self.unread["skins; their meshes stand as stored"] = None
        matrix = self._to_metres @ np.array(to_world).T
        if not np.isfinite(matrix).all():
            raise ValueError(f"{prim.GetPath()}: its transform is not finite")
        for placed in self._parts(prim):
            geometry = self.geometries[placed.geometry]
            self._triangles += len(geometry.triangles)
            self._vertices += len(geometry.positions)
            if self._triangles > MAX_TRIANGLES or self._vertices > MAX_VERTICES:
                raise ValueError(f"more than {MAX_TRIANGLES} triangles or {MAX_VERTICES} vertices")
            self.placed.append(placed)
            self.matrices.append(matrix)

    def _parts(self, prim: Any) -> list[Placed]:
        """Return the geometries of a prim, one for each material; instances share them."""
        own = self.materials.of(prim)
        is_mesh = prim.GetTypeName() == "Mesh"
        parts = list(subsets(prim, self._time)) if is_mesh else []
        materials = (own, *(self.materials.of(subset) for subset, _ in parts))
        stored = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        key = str(stored.GetPath()), materials
        if key not in self._read:
            self._note_motion(prim)
            if is_mesh:
                faces = [polygons for _, polygons in parts]
                self._read[key] = self._mesh_parts(prim, materials, faces)
            else:
                whole = solid_geometry(prim, self._time, colored=own is None)
                self._read[key] = [self._kept(whole, own)]
        return self._read[key]

    def _mesh_parts(
        self, prim: Any, materials: tuple[int | None, ...], faces: list[NDArray[np.int64]]
    ) -> list[Placed]:
        """Return the parts of a mesh by material; polygons of no subset have the first."""
        parts = []
        read: dict[Needs, tuple[Geometry, NDArray[np.int64]]] = {}
        for number, index in enumerate(materials):
            needs = Needs.of(None if index is None else self.materials.read[index])
            if needs not in read:
                read[needs] = mesh_geometry(prim, self._time, needs, self.unread)
            geometry, of_face = read[needs]
            chosen = _owners(faces, int(of_face.max(initial=-1)) + 1)[of_face] == number
            if chosen.any():
                geometry = geometry if chosen.all() else geometry.part(chosen)
                parts.append(self._kept(geometry, index))
        return parts

    def _kept(self, geometry: Geometry, material: int | None) -> Placed:
        self.geometries.append(geometry)
        return Placed(geometry=len(self.geometries) - 1, material=material)

    def _note_motion(self, prim: Any) -> None:
        """Note that a prim, or what places it, moves."""
        moves = any(
            prim.GetAttribute(name).ValueMightBeTimeVarying()
            for name in ("points", "normals")
            if prim.HasAttribute(name)
        )
        while prim and not moves and not prim.IsPseudoRoot():
            xformable = UsdGeom.Xformable(prim)
            moves = bool(xformable) and xformable.TransformMightBeTimeVarying()
            prim = prim.GetParent()
        if moves:
            self.unread["animation; its first time is shown"] = None

    def _name(self, prim: Any) -> None:
        """Count a prim that is not read, if it would show."""
        kind = printable(str(prim.GetTypeName()), 60)
        if prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Camera) or prim.HasAPI("LightAPI"):
            self._others[kind] += 1


def _owners(faces: list[NDArray[np.int64]], count: int) -> NDArray[np.int64]:
    """Return the number, from 1, of the last subset that holds each polygon (count,); 0: none."""
    owners = np.zeros(count, np.int64)
    for number, polygons in enumerate(faces, 1):
        owners[polygons[(polygons >= 0) & (polygons < count)]] = number
    return owners


def _to_metres(stage: Any) -> NDArray[np.float64]:
    """Return the (4, 4) transform from a stage's units and axes to metres, +Y up."""
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    if not 0.0 < unit < np.inf:
        raise ValueError(f"metersPerUnit is {unit:g}")
    matrix = np.diag([unit, unit, unit, 1.0])
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
        turn = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)
        matrix = turn @ matrix
    return matrix


def placed_arrays(reader: StageReader) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield all arrays of a reader by name: of each geometry, and `matrices`."""
    for number, geometry in enumerate(reader.geometries):
        for name, array in geometry.arrays().items():
            yield f"{name} {number}", array
    yield "matrices", np.array(reader.matrices).reshape(-1, 4, 4)
