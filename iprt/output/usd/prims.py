"""Arrays, transforms and names as USD has them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, UsdGeom, Vt

from iprt.geometry.mesh import Mesh

Float = NDArray[np.float64]
FIRST, SECOND = "st", "st1"
"""Names of sets of texture coordinates."""


def usable_name(name: str, taken: Iterable[str] = ()) -> str:
    """Return a name for a prim, not among `taken`, in letters, digits and underscores."""
    base = re.sub(r"\W", "_", name, flags=re.ASCII) or "_"
    base = f"_{base}" if base[0].isdigit() else base
    number, chosen, others = 2, base, set(taken)
    while chosen in others:
        chosen, number = f"{base}_{number}", number + 1
    return chosen


def matrix(transform: Float) -> Any:
    """Return a (4, 4) transform of columns as USD's, which is one of rows."""
    return Gf.Matrix4d(transform.T.tolist())


def place(prim: Any, transform: Float, samples: Iterable[tuple[int, Float]] = ()) -> None:
    """Set the transform of a prim, and transforms by time code if it moves."""
    operation = UsdGeom.Xformable(prim).AddTransformOp()
    operation.Set(matrix(transform))
    for code, moved in samples:
        operation.Set(matrix(moved), code)


def define_mesh(stage: Any, path: str, mesh: Mesh) -> Any:
    """Define a mesh prim of triangles with normals and texture coordinates."""
    prim = triangles(stage, path, mesh.positions, mesh.triangles)
    prim.CreateNormalsAttr(vectors(mesh.normals))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    coordinates(prim, mesh.uvs, UsdGeom.Tokens.vertex)
    if mesh.uvs2 is not None:
        coordinates(prim, mesh.uvs2, UsdGeom.Tokens.vertex, SECOND)
    return prim


def triangles(
    stage: Any, path: str, positions: NDArray[np.floating], corners: NDArray[np.integer]
) -> Any:
    """Define a mesh prim of triangles (F, 3), which is no subdivision surface."""
    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreatePointsAttr(vectors(positions))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(corners), 3, np.int32)))
    indices = np.ascontiguousarray(corners.ravel(), np.int32)
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices))
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(prim.GetPointsAttr().Get()))
    return prim


def vectors(values: NDArray[np.floating]) -> Any:
    """Return an array (N, 3) as USD's."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def coordinates(
    prim: Any, uvs: NDArray[np.floating], interpolation: str, name: str = FIRST
) -> None:
    """Set texture coordinates (N, 2) of a mesh prim, v up."""
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
        name, Sdf.ValueTypeNames.TexCoord2fArray, interpolation
    )
    primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uvs, np.float32)))
