"""The arrow of the sun's light, which both viewers draw over the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.scene.light_edits import angles_of
from iprt.viewer.picking import Picking

Float = NDArray[np.float64]

COLOR = (255, 205, 70)
"""Color (RGB) of the arrow."""
LENGTH = 0.5
"""Length of the arrow relative to half the height of the view at its distance."""
HEAD, WIDTH = 0.22, 0.09
"""Length and radius of the arrow's head, relative to the arrow."""
AHEAD_M = 2.0
"""Distance of the arrow's point where no surface is known."""
MARGIN = 0.2
"""Share of the picture's width and height near its border where the arrow does not stay."""


@dataclass(frozen=True, eq=False)
class SunArrow:
    """An arrow along the light of the sun.

    Attributes
    ----------
    point : (3,) float64
        Where it points to, in the world.
    towards : (3,) float64
        Unit vector towards the sun.
    length : float
        In metres.
    """

    point: Float
    towards: Float
    length: float

    @property
    def turn(self) -> Float:
        """(3, 3) rotation from +Y to the direction of the sun."""
        yaw = np.deg2rad(angles_of(self.towards.tolist())[0])
        right = np.array([np.cos(yaw), 0.0, np.sin(yaw)])
        return np.stack([right, self.towards, np.cross(right, self.towards)], axis=-1)

    def drawn(self, view: View, centre: Float) -> Float | None:
        """Return its shaft and head in a view from a capture centre (3,).

        Returns
        -------
        (4, 2) float64 or None
            End, point, and both corners of the head, in pixels of the view. None if one of them is
            behind the camera.
        """
        end = self.point + self.length * self.towards
        ahead = self.point - centre
        side = np.cross(self.towards, ahead)
        side /= max(float(np.linalg.norm(side)), 1e-12)
        neck = self.point + HEAD * self.length * self.towards
        wide = WIDTH * self.length * side
        places = np.stack([end, self.point, neck + wide, neck - wide]) - centre
        if (places @ view.world_from_view[:, 2] > -1e-3).any():
            return None
        return view.project(places)


class ArrowPlace:
    """The place in the picture that the arrow points to: the surface in the middle.

    It stays there while the view turns, until it comes near the picture's border.
    """

    def __init__(self) -> None:
        self._point: Float | None = None

    def arrow(self, picking: Picking, view: View, centre: Float, towards: Float) -> SunArrow:
        """Return the arrow of a sun in a view from a capture centre (3,)."""
        point = self._point
        if point is None or not _inside(view, point - centre):
            ground = picking.ground(0.5, 0.5, 0.0)
            self._point = None if ground is None else ground.point
            point = self._point
        if point is None:
            point = centre - AHEAD_M * view.world_from_view[:, 2]
        distance = float(np.linalg.norm(point - centre))
        half = np.tan(np.deg2rad(0.5 * view.fov_y_deg))
        return SunArrow(point, towards, float(LENGTH * half * distance))


def _inside(view: View, point: Float) -> bool:
    """Return True if a point (3,) from the capture centre is away from the picture's border."""
    if point @ view.world_from_view[:, 2] > -1e-3:
        return False
    share = view.project(point) / (view.width, view.height)
    return bool((np.abs(share - 0.5) < 0.5 - MARGIN).all())
