"""Lights without geometry."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from iprt.device.kernel_source import constant

LightKind = Literal["sphere", "rectangle", "sun"]
_HEADER = "lib/world/objects/virtual_lights.h"
MOST_LIGHTS = constant(_HEADER, "MOST_LIGHTS")
PROFILE_SHAPE = constant(_HEADER, "PROFILE_ROWS"), constant(_HEADER, "PROFILE_COLUMNS")
"""Angles from the axis, 1 degree apart, and around it, 5 degrees apart."""
SUN_DEG = 0.53
"""Angular diameter of the sun, in degrees."""
_SHOWN = 0.05
_NARROWEST = 1e-3


@dataclass(frozen=True)
class Light:
    """A light without geometry, in its object's space: at the origin, shining along -Z.

    Neither the view nor mirrors show it. Its light ends at objects and real surfaces.

    Attributes
    ----------
    kind : {"sphere", "rectangle", "sun"}
        A sphere, or a point where `radius` is 0; a rectangle in the plane z = 0, which shines to
        one side in proportion to the cosine; or a distant disc.
    intensity : (r, g, b)
        Radiant intensity along the axis, in the panorama's unit of radiance times m². Of the sun:
        irradiance of a surface that faces it.
    radius : float
        Metres, of a sphere.
    cone_deg : (inner, outer) or None
        Half angles of a spot. Inside of `inner` the intensity is constant. It falls to 0 at
        `outer`, as the square of a linear function of the cosine (Khronos KHR_lights_punctual).
    size : (width, height)
        Metres, of a rectangle.
    diameter_deg : float
        Angular diameter of the sun.
    profile : PROFILE_SHAPE float32 or None
        Intensity of a sphere relative to the axis's `intensity`, by the angle from -Z and by the
        angle from +X towards +Y around it.
    """

    kind: LightKind = "sphere"
    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    radius: float = 0.0
    cone_deg: tuple[float, float] | None = None
    size: tuple[float, float] = (0.5, 0.5)
    diameter_deg: float = SUN_DEG
    profile: NDArray[np.float32] | None = field(default=None, compare=False)

    @property
    def cone(self) -> tuple[float, float]:
        """Cosines of `cone_deg`, which must not be None; the edge has at least a little width."""
        assert self.cone_deg is not None
        inner, outer = np.cos(np.deg2rad(self.cone_deg))
        return float(inner), float(min(outer, inner - _NARROWEST))

    @property
    def solid_angle(self) -> float:
        """Integral over all directions of the intensity relative to the axis, in sr; not of a sun.

        A rectangle has π: its intensity is proportional to the cosine on one side.
        """
        if self.kind == "rectangle":
            return np.pi
        if self.profile is not None:
            edges = np.cos(np.linspace(0.0, np.pi, len(self.profile)))
            around = 0.5 * (self.profile[:, 1:] + self.profile[:, :-1]).mean(axis=1, dtype=float)
            return float(2.0 * np.pi * np.trapezoid(around, -edges))
        if self.cone_deg is None:
            return 4.0 * np.pi
        inner, outer = self.cone
        return float(2.0 * np.pi * (1.0 - inner + (inner - outer) / 3.0))

    @property
    def reach(self) -> tuple[float, float, float]:
        """Half sides of a box around it that is large enough to be seen, in metres."""
        if self.kind == "rectangle":
            return 0.5 * self.size[0], 0.5 * self.size[1], 0.0
        reach = max(self.radius, _SHOWN)
        return reach, reach, reach
