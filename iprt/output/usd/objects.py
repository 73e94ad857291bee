"""The objects of a scene on a USD stage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pxr import UsdGeom, UsdShade, Vt

from iprt.geometry.animated_mesh import AnimatedMesh
from iprt.geometry.mesh import Mesh
from iprt.output.usd.lights import write_light
from iprt.output.usd.materials import MaterialWriter
from iprt.output.usd.prims import define_mesh, place, usable_name, vectors
from iprt.scene.objects import SceneObject

Times = Sequence[tuple[int, float]]
"""Time codes, which are numbers of frames, with their times in seconds."""


def write_objects(
    stage: Any,
    scope: str,
    objects: Sequence[SceneObject],
    materials: MaterialWriter,
    time_s: float,
    times: Times,
) -> None:
    """Write each object below `scope`, as it is at a time and, if it moves, at `times`."""
    taken: list[str] = []
    for entry in objects:
        name = usable_name(entry.name, taken)
        taken.append(name)
        light = entry.mesh.light if isinstance(entry.mesh, Mesh) else None
        if light is not None:
            motion = entry.motion
            moved = ((code, motion.at(seconds)) for code, seconds in times if motion.moves)
            write_light(stage, f"{scope}/{name}", light, motion.at(time_s), moved)
            continue
        prim = UsdGeom.Xform.Define(stage, f"{scope}/{name}")
        prim.GetPrim().SetDisplayName(entry.name)
        motion = entry.motion
        moved = ((code, motion.at(seconds)) for code, seconds in times if motion.moves)
        place(prim, motion.at(time_s), moved)
        mesh = entry.mesh.at(time_s) if isinstance(entry.mesh, AnimatedMesh) else entry.mesh
        shape = define_mesh(stage, f"{scope}/{name}/mesh", mesh)
        _bind(shape, mesh, materials, name)
        if isinstance(entry.mesh, AnimatedMesh):
            _write_motion(shape, entry.mesh, times)


def _write_motion(shape: Any, mesh: AnimatedMesh, times: Times) -> None:
    """Write the vertices of a mesh that an animation moves or bends."""
    for code, seconds in times:
        bent = mesh.at(seconds)
        points = vectors(bent.positions)
        shape.GetPointsAttr().Set(points, code)
        shape.GetNormalsAttr().Set(vectors(bent.normals), code)
        shape.GetExtentAttr().Set(UsdGeom.PointBased.ComputeExtent(points), code)


def _bind(shape: Any, mesh: Mesh, materials: MaterialWriter, name: str) -> None:
    """Bind the materials of a mesh: one to all of it, several to subsets of its faces."""
    used = np.unique(mesh.material_index)
    binding = UsdShade.MaterialBindingAPI.Apply(shape.GetPrim())
    if len(used) == 1:
        binding.Bind(materials.of(mesh.materials[used[0]], name))
        return
    for index in used:
        faces = np.flatnonzero(mesh.material_index == index).astype(np.int32)
        subset = binding.CreateMaterialBindSubset(
            f"material_{index}", Vt.IntArray.FromNumpy(faces), UsdGeom.Tokens.face
        )
        bound = UsdShade.MaterialBindingAPI.Apply(subset.GetPrim())
        bound.Bind(materials.of(mesh.materials[index], f"{name}_{index}"))
    binding.SetMaterialBindSubsetsFamilyType(UsdGeom.Tokens.partition)
