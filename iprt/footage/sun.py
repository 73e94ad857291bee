"""A distant light that the panorama need not show."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

DISC_DEG = 0.53
"""Angular diameter of the sun."""
OUTDOORS = 0.1
"""Least share of open sky in the upper half of an outdoor panorama's picture."""


def is_outdoors(sky: NDArray[np.generic]) -> bool:
    """Return whether a panorama was taken outdoors, from the share (H, W) of open sky in texels."""
    return bool(sky[: len(sky) // 2].mean() > OUTDOORS)


@dataclass(frozen=True)
class Sun:
    """A distant light.

    Attributes
    ----------
    direction : (3,) float64
        Unit vector towards it, in world space: the axes of the poses, if the camera moves.
    irradiance : three floats
        Of a surface perpendicular to it, per color: the panorama's unit of radiance times sr.
    angle_deg : float
        Angular diameter in degrees.
    correlation : float or None
        Evidence of a found one; None if declared.
    """

    direction: NDArray[np.float64]
    irradiance: tuple[float, float, float]
    angle_deg: float = DISC_DEG
    correlation: float | None = None

    def seen_from(self, pose: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """Return the direction in the axes of a capture centre with a (4, 4) pose; None: world."""
        return self.direction if pose is None else np.asarray(pose[:3, :3].T @ self.direction)

    def dimmed(self, share: float) -> Sun:
        """Return the sun with a share of its irradiance."""
        red, green, blue = self.irradiance
        return replace(self, irradiance=(share * red, share * green, share * blue))

    @property
    def sine_squared(self) -> float:
        """Squared sine of the disc's radius."""
        return math.sin(math.radians(0.5 * self.angle_deg)) ** 2

    @property
    def solid_angle(self) -> float:
        """Projected solid angle of the disc, in sr."""
        return math.pi * self.sine_squared

    @property
    def radiance(self) -> tuple[float, float, float]:
        """Radiance of the disc, the same everywhere."""
        red, green, blue = (part / self.solid_angle for part in self.irradiance)
        return red, green, blue
