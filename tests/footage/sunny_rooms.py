"""Analytic rooms with a window, lit by a sky and by a sun that the capture centre does not see."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from tests.oracles.worlds import World
from tests.worlds import room_frame

Float = NDArray[np.float64]

SKY, AROUND = 3.0, 1.0
"""Radiance of the sky, and irradiance over pi of all surfaces by all but the sun."""


@dataclass(frozen=True)
class SunnyRoom:
    """A closed room with panes of glass in the wall at its largest x.

    Attributes
    ----------
    sun : (3,)
        Direction; unit length.
    irradiance : three floats
        Perpendicular to the sun; 0: none.
    panes : list of (4,)
        Lowest and highest z, lowest and highest y.
    """

    sun: Float
    irradiance: tuple[float, float, float] = (6.0, 5.0, 4.0)
    panes: tuple[tuple[float, float, float, float], ...] = (
        (-1.2, -0.1, -0.4, 1.0),
        (0.1, 0.9, -0.4, 1.0),
    )
    world: World = field(default_factory=World)

    def frame(self, width: int, height: int) -> Frame:
        """The panorama; radiance over diffuse surfaces of several reflectances."""
        frame = room_frame(self.world, width, height, self.radiance)
        d = View(width, height, projection="equirect").directions()
        return replace(frame, opening=self._at_window(frame.depth[..., None] * d))

    def radiance(self, points: Float, normals: Float) -> Float:
        """Radiance (..., 3) of walls and panes at points (..., 3) with normals (..., 3)."""
        albedo = 0.5 + 0.2 * np.sin(2.0 * points).prod(-1)
        sun = np.maximum(normals @ self.sun, 0.0) * self.sunlit(points)
        light = AROUND + sun[..., None] * np.asarray(self.irradiance) / np.pi
        return np.where(self._at_window(points)[..., None], SKY, albedo[..., None] * light)

    def sunlit(self, points: Float) -> NDArray[np.bool_]:
        """Return whether the sun reaches points (..., 3) through a pane."""
        way = (self.world.high[0] - points[..., 0]) / self.sun[0]
        there = self._in_pane(points + way[..., None] * self.sun)
        return np.asarray(there & ~self._at_window(points))

    def _in_pane(self, points: Float) -> NDArray[np.bool_]:
        found = np.zeros(points.shape[:-1], bool)
        for z0, z1, y0, y1 in self.panes:
            z, y = points[..., 2], points[..., 1]
            found |= (z > z0) & (z < z1) & (y > y0) & (y < y1)
        return found

    def _at_window(self, points: Float) -> NDArray[np.bool_]:
        return np.asarray((points[..., 0] > self.world.high[0] - 1e-3) & self._in_pane(points))
