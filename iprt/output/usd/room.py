"""The real scene on a USD stage: its visible surfaces, the panorama around them, and the sun."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, UsdGeom, UsdLux, UsdShade
from scipy.spatial.transform import Rotation

from iprt.footage.depth_mesh import DepthMesh, depth_mesh
from iprt.footage.frame import Frame
from iprt.footage.sun import Sun
from iprt.output.usd.materials import radiant_material
from iprt.output.usd.prims import coordinates, place, triangles

DOME_TURN_DEG = 180.0
"""Rotation about +Y that takes the directions of a dome's picture to the panorama's. The middle of
the picture is +Z by OpenEXR's convention for latitude-longitude maps, which UsdLuxDomeLight has,
and -Z by iprt's. Both have the picture's left at the left of who looks there."""


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


def write_dome(stage: Any, path: str, file: str) -> None:
    """Write a dome light that shows the picture `file` in the directions of the panorama."""
    dome = UsdLux.DomeLight.Define(stage, path)
    dome.CreateTextureFileAttr(file)
    dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    UsdGeom.Xformable(dome).AddRotateYOp().Set(DOME_TURN_DEG)


def write_sun(stage: Any, path: str, sun: Sun) -> None:
    """Write a distant light, which shines along its -Z axis, of the sun's irradiance."""
    light = UsdLux.DistantLight.Define(stage, path)
    strength = max(sun.irradiance)
    light.CreateIntensityAttr(strength)
    light.CreateColorAttr(Gf.Vec3f(*(part / strength for part in sun.irradiance)))
    light.CreateAngleAttr(sun.angle_deg)
    light.CreateNormalizeAttr(True)  # intensity is then irradiance, whatever the angle
    transform = np.eye(4)
    transform[:3, :3] = Rotation.align_vectors([sun.direction], [[0.0, 0.0, 1.0]])[0].as_matrix()
    place(light, transform)
