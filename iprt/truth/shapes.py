"""Meshes and materials as Mitsuba objects, equivalent to the renderer's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.material import MIRROR_ALPHA, Material
from iprt.geometry.mesh import Instance, transformed
from iprt.truth.backend import mitsuba


class Triangles(Protocol):
    """Indexed triangles with smooth normals and texture coordinates."""

    @property
    def positions(self) -> NDArray[Any]:
        """Positions (V, 3)."""

    @property
    def normals(self) -> NDArray[Any]:
        """Unit normals (V, 3)."""

    @property
    def uvs(self) -> NDArray[Any]:
        """Texture coordinates (V, 2)."""

    @property
    def triangles(self) -> NDArray[Any]:
        """Vertex indices (F, 3)."""


def mitsuba_mesh(mesh: Triangles, bsdf: Any, emitter: Any = None) -> Any:
    """Return a Mitsuba mesh in world space, smoothly shaded.

    Parameters
    ----------
    mesh : Triangles
        Positions and normals (V, 3), texture coordinates (V, 2), triangles (F, 3).
    bsdf, emitter : dict or Mitsuba object
    """
    mi = mitsuba()
    props = mi.Properties()
    props["bsdf"] = mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf
    if emitter is not None:
        props["emitter"] = mi.load_dict(emitter) if isinstance(emitter, dict) else emitter
    shape = mi.Mesh(
        "mesh",
        vertex_count=len(mesh.positions),
        face_count=len(mesh.triangles),
        has_vertex_normals=True,
        has_vertex_texcoords=True,
        props=props,
    )
    params = mi.traverse(shape)
    params["vertex_positions"] = np.ascontiguousarray(mesh.positions, np.float32).ravel()
    params["vertex_normals"] = np.ascontiguousarray(mesh.normals, np.float32).ravel()
    params["vertex_texcoords"] = np.ascontiguousarray(mesh.uvs, np.float32).ravel()
    params["faces"] = np.ascontiguousarray(mesh.triangles, np.uint32).ravel()
    params.update()
    return shape


def bsdf_of(material: Material) -> dict[str, Any]:
    """Return the Mitsuba BSDF of a virtual object's material."""
    mi = mitsuba()
    color: dict[str, Any] = {"type": "rgb", "value": list(material.albedo)}
    if material.texture is not None:
        tinted = material.texture[::-1] * np.array(material.albedo, np.float32)
        color = {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(tinted, np.float32)),
            "raw": True,
        }
    smooth = material.alpha < MIRROR_ALPHA
    if material.kind == "diffuse":
        return {"type": "diffuse", "reflectance": color}
    if material.kind == "conductor":
        metal = {"material": "none", "specular_reflectance": color}
        if smooth:
            return {"type": "conductor", **metal}
        return {
            "type": "roughconductor",
            "distribution": "ggx",
            "alpha": material.alpha,
            **metal,
        }
    coat = {"int_ior": material.ior, "nonlinear": False, "diffuse_reflectance": color}
    if smooth:
        return {"type": "plastic", **coat}
    return {"type": "roughplastic", "distribution": "ggx", "alpha": material.alpha, **coat}


def instance_shapes(instances: Sequence[Instance]) -> dict[str, Any]:
    """Return Mitsuba shapes of placed meshes, one per material that triangles use."""
    shapes = {}
    for number, instance in enumerate(instances):
        mesh, to_world = instance.mesh, instance.to_world
        normals = mesh.normals @ np.linalg.inv(to_world[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        positions = transformed(to_world, mesh.positions)
        placed = replace(
            mesh, positions=positions.astype(np.float32), normals=normals.astype(np.float32)
        )
        for index, material in enumerate(mesh.materials):
            triangles = mesh.triangles[mesh.material_index == index]
            if len(triangles):
                part = replace(placed, triangles=triangles)
                bsdf = {"type": "twosided", "bsdf": bsdf_of(material)}
                # Mitsuba gives dots in names a meaning of their own.
                shapes[f"object_{number}_{index}"] = mitsuba_mesh(part, bsdf)
    return shapes
