"""The visible surfaces of the real scene on a USD stage."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdShade

from iprt.footage.depth_mesh import DepthMesh, depth_mesh
from iprt.footage.frame import Frame
from iprt.output.usd.materials import radiant_material
from iprt.output.usd.prims import coordinates, triangles


def write_room(stage: Any, scope: str, frame: Frame, size: tuple[int, int], file: str) -> None:
    """Write the visible surfaces as the mesh `surfaces` that shows the picture `file`.

    There is no surface where the source has no depth, so that light from the dome passes through
    windows.
    """
    mesh = depth_mesh(frame, size)
    opening = np.append(frame.opening[np.ix_(mesh.rows, mesh.columns)].ravel(), (False, False))
    corners = mesh.triangles[~opening[mesh.triangles].any(axis=1)]
    prim = triangles(stage, f"{scope}/surfaces", mesh.positions, corners)
    coordinates(prim, corner_uvs(mesh, corners, frame), UsdGeom.Tokens.faceVarying)
    look = radiant_material(stage, f"{scope}/radiance", file)
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(look)


def corner_uvs(mesh: DepthMesh, corners: NDArray[np.int64], frame: Frame) -> NDArray[np.float32]:
    """Return the texture coordinates (3 F, 2) of triangles' corners in the panorama.

    Triangles across the seam at 180° go on beyond u = 1, where the picture repeats. At a pole,
    each triangle has the u of its middle.
    """
    u = np.tile((mesh.columns + 0.5) / frame.width, len(mesh.rows))
    v = np.repeat(1.0 - (mesh.rows + 0.5) / frame.height, len(mesh.columns))
    at_pole = corners >= len(u)
    u, v = (np.append(values, poles) for values, poles in ((u, (0.0, 0.0)), (v, (1.0, 0.0))))
    across = u[corners]
    most = np.max(across, axis=1, keepdims=True)
    across += (most - across > 0.5) & ~at_pole
    middle = across.sum(axis=1, keepdims=True, where=~at_pole) / (~at_pole).sum(
        axis=1, keepdims=True
    )
    across = np.where(at_pole, middle, across)
    return np.stack([across, v[corners]], axis=-1).reshape(-1, 2).astype(np.float32)
