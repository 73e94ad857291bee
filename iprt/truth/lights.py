"""Lights without geometry as Mitsuba emitters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.geometry.light import Light
from iprt.geometry.mesh import Instance
from iprt.truth.backend import mitsuba

_TURN = np.diag([-1.0, 1.0, -1.0, 1.0])
"""Mitsuba's spots and rectangles shine along +Z."""


def instance_lights(instances: Sequence[Instance]) -> dict[str, Any]:
    """Return Mitsuba emitters of the lights without geometry.

    Mitsuba shows rectangles and spheres. Its spots fall off linearly with the angle, and its suns
    have no extent.

    Raises
    ------
    IprtError
        A light has a photometric profile, which Mitsuba cannot have.
    """
    emitters = {}
    for number, instance in enumerate(instances):
        light = instance.mesh.light
        if light is not None:
            if light.profile is not None:
                raise IprtError(
                    f"{instance.name}: Mitsuba has no lights with a photometric profile; "
                    "remove the profile for references"
                )
            emitters[f"light_{number}"] = _emitter(light, instance.to_world)
    return emitters


def _emitter(light: Light, to_world: NDArray[np.float64]) -> dict[str, Any]:
    lengths = np.linalg.norm(to_world[:3, :3], axis=0)
    placed = to_world.copy()
    placed[:3, :3] /= lengths
    place = placed[:3, 3].tolist()
    towards = mitsuba().ScalarTransform4f(placed @ _TURN)
    if light.kind == "sun":
        direction = (-placed[:3, 2]).tolist()
        return {"type": "directional", "direction": direction, "irradiance": _rgb(light.intensity)}
    if light.kind == "rectangle":
        half = 0.5 * np.array(light.size) * lengths[:2]
        scaled = mitsuba().ScalarTransform4f(placed @ _TURN @ np.diag([*half, 1.0, 1.0]))
        radiance = np.array(light.intensity) / (4.0 * half[0] * half[1])
        return {"type": "rectangle", "to_world": scaled, "emitter": _area(radiance)}
    if light.cone_deg is not None:
        inner, outer = light.cone_deg
        return {
            "type": "spot",
            "to_world": towards,
            "intensity": _rgb(light.intensity),
            "beam_width": min(inner, outer - 1e-3),
            "cutoff_angle": outer,
        }
    radius = light.radius * lengths[0]
    if radius > 0.0:
        radiance = np.array(light.intensity) / (np.pi * radius**2)
        return {"type": "sphere", "center": place, "radius": radius, "emitter": _area(radiance)}
    return {"type": "point", "position": place, "intensity": _rgb(light.intensity)}


def _area(radiance: NDArray[np.float64]) -> dict[str, Any]:
    return {"type": "area", "radiance": _rgb(radiance)}


def _rgb(values: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(value) for value in values]}
