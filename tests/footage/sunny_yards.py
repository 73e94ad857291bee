"""Analytic yards under open sky, with a sun that is behind a pillar or in sight."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from tests.oracles.worlds import Box
from tests.worlds import frame_of

Float = NDArray[np.float64]

GROUND = -1.5
SKY, AROUND = 0.8, 0.5
"""Radiance of the sky, and irradiance over pi of all surfaces by all but the sun."""
SOLIDS = (
    Box((0.0, GROUND - 1.0, 0.0), (30.0, 1.0, 30.0)),
    Box((-1.45, -0.3, 0.0), (0.25, 1.2, 0.6)),
    Box((1.3, GROUND + 0.4, -1.2), (0.3, 0.4, 0.2)),
    Box((0.9, GROUND + 0.25, 1.7), (0.25, 0.25, 0.5), 0.4),
)
"""Ground, a pillar in front of the capture centre, and two boxes."""
LIFT = 1e-6


@dataclass(frozen=True)
class SunnyYard:
    """Ground and solids, lit by a sky and a sun.

    Attributes
    ----------
    sun : (3,)
        Direction; unit length.
    irradiance : three floats
        Perpendicular to the sun; 0: none.
    """

    sun: Float
    irradiance: tuple[float, float, float] = (6.0, 5.0, 4.0)

    def first_hit(self, o: Float, d: Float) -> tuple[Float, Float]:
        """Distance (...), inf in the sky, and outward normal (..., 3) where rays meet a solid."""
        nearest, normal = np.full(np.broadcast(o, d).shape[:-1], np.inf), np.zeros(d.shape)
        for solid in SOLIDS:
            t, _, facing, _ = solid.interval(o, d)
            nearer = (t > 0.0) & (t < nearest)
            nearest = np.where(nearer, t, nearest)
            normal = np.where(nearer[..., None], facing, normal)
        return nearest, normal

    def radiance(self, o: Float, d: Float) -> Float:
        """Radiance (..., 3) that arrives along rays."""
        t, normal = self.first_hit(o, d)
        points = o + np.where(np.isfinite(t), t, 0.0)[..., None] * d
        albedo = 0.5 + 0.1 * np.sin(2.0 * points).prod(-1)
        facing = np.maximum(normal @ self.sun, 0.0) * self.sunlit(points + LIFT * normal)
        light = AROUND + facing[..., None] * np.asarray(self.irradiance) / np.pi
        return np.where(np.isfinite(t)[..., None], albedo[..., None] * light, SKY)

    def sunlit(self, points: Float) -> NDArray[np.bool_]:
        """Return whether no solid is between points (..., 3) and the sun."""
        return np.isinf(self.first_hit(points, np.broadcast_to(self.sun, points.shape))[0])

    def frame(self, width: int, height: int) -> Frame:
        """The panorama, in which the sun has no disc."""
        d = View(width, height, projection="equirect").directions()
        t, normal = self.first_hit(np.zeros(3), d)
        color = self.radiance(np.zeros(3), d).astype(np.float32)
        return replace(frame_of(t, normal), color=color)
