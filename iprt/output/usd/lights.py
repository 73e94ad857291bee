"""Lights on a USD stage, as UsdLux defines them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, UsdGeom, UsdLux
from scipy.spatial.transform import Rotation

from iprt.footage.sun import Sun
from iprt.geometry.light import Light
from iprt.output.usd.prims import place

DOME_TURN_DEG = 180.0
"""Rotation about +Y that takes the directions of a dome's picture to the panorama's. The middle of
the picture is +Z by OpenEXR's convention for latitude-longitude maps, which UsdLuxDomeLight has,
and -Z by iprt's. Both have the picture's left at the left of who looks there."""
POINT_RADIUS_M = 0.001
"""Radius of points, which UsdLux does not have; renderers that know the flag treat them as such."""


def write_dome(stage: Any, path: str, file: str) -> None:
    """Write a dome light that shows the picture `file` in the directions of the panorama."""
    dome = UsdLux.DomeLight.Define(stage, path)
    dome.CreateTextureFileAttr(file)
    dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    UsdGeom.Xformable(dome).AddRotateYOp().Set(DOME_TURN_DEG)


def write_sun(stage: Any, path: str, sun: Sun) -> None:
    """Write a distant light, which shines along its -Z axis, of the sun's irradiance."""
    light = _distant(stage, path, sun.irradiance, sun.angle_deg)
    transform = np.eye(4)
    transform[:3, :3] = Rotation.align_vectors([sun.direction], [[0.0, 0.0, 1.0]])[0].as_matrix()
    place(light, transform)


def write_light(
    stage: Any,
    path: str,
    light: Light,
    to_world: NDArray[np.float64],
    moved: Iterable[tuple[int, NDArray[np.float64]]],
) -> None:
    """Write a light without geometry, and its transform, also at the time codes of `moved`.

    The intensity of a sphere or rectangle is normalized, so that it does not depend on the size: a
    sphere of intensity I in all directions has the power 4 π I, from the area 4 π r² of radiance
    I / (π r²). A photometric profile is left out.
    """
    if light.kind == "sun":
        written = _distant(stage, path, light.intensity, light.diameter_deg)
    elif light.kind == "rectangle":
        written = UsdLux.RectLight.Define(stage, path)
        written.CreateWidthAttr(light.size[0])
        written.CreateHeightAttr(light.size[1])
        _shine(written, light.intensity)
    else:
        written = UsdLux.SphereLight.Define(stage, path)
        written.CreateRadiusAttr(light.radius or POINT_RADIUS_M)
        written.CreateTreatAsPointAttr(light.radius == 0.0)
        red, green, blue = (4.0 * part for part in light.intensity)
        _shine(written, (red, green, blue))
    if light.cone_deg is not None:
        inner, outer = light.cone_deg
        shaping = UsdLux.ShapingAPI.Apply(written.GetPrim())
        shaping.CreateShapingConeAngleAttr(outer)
        shaping.CreateShapingConeSoftnessAttr(1.0 - inner / outer if outer > 0.0 else 0.0)
    place(written, to_world, moved)


def _distant(
    stage: Any, path: str, irradiance: tuple[float, float, float], angle_deg: float
) -> Any:
    light = UsdLux.DistantLight.Define(stage, path)
    light.CreateAngleAttr(angle_deg)
    _shine(light, irradiance)  # intensity is then irradiance, whatever the angle
    return light


def _shine(light: Any, intensity: tuple[float, float, float]) -> None:
    """Set a normalized intensity, as a strength and a color."""
    strength = max(intensity)
    light.CreateIntensityAttr(strength)
    light.CreateColorAttr(Gf.Vec3f(*(part / max(strength, 1e-30) for part in intensity)))
    light.CreateNormalizeAttr(True)
