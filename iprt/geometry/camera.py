"""Views and their two projections, both centred on the 360° capture centre.

World: right-handed, +Y up, metres, origin at the capture centre. View space: +X right, +Y up,
-Z forward. Pixel centres are at integer + 0.5; row 0 is the top.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.equirect import equirect_direction, equirect_pixel

Projection = Literal["perspective", "equirect"]
Float = NDArray[np.float64]


@dataclass(frozen=True)
class View:
    """Size, direction and projection of a picture to render from the capture centre.

    Attributes
    ----------
    width, height : int
        Pixels.
    yaw_deg : float
        Rotation to the right, towards +X.
    pitch_deg : float
        Rotation upwards.
    fov_y_deg : float
        Vertical field of view; unused by the equirect projection.
    projection : {"perspective", "equirect"}
        An equirect view is the whole panorama, in the convention of the scene format.
    """

    width: int
    height: int
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    fov_y_deg: float = 60.0
    projection: Projection = "perspective"

    def resized(self, width: int, height: int) -> View:
        """Return this view at another size in pixels."""
        return replace(self, width=width, height=height)

    def reduced(self, scale: int) -> View:
        """Return this view with one pixel for every `scale` x `scale` pixels, rounded up.

        If `scale` does not divide the size, a perspective view grows a little on all sides.
        """
        width, height = -(-self.width // scale), -(-self.height // scale)
        half = 0.5 * height * scale / self.focal_px
        fov = float(np.rad2deg(2.0 * np.arctan(half)))
        return replace(self, width=width, height=height, fov_y_deg=fov)

    @cached_property
    def world_from_view(self) -> Float:
        """(3, 3) rotation from view-space to world-space directions; do not modify it."""
        yaw, pitch = np.deg2rad(self.yaw_deg), np.deg2rad(self.pitch_deg)
        cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
        turn = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
        return np.asarray(turn @ tilt)

    @property
    def focal_px(self) -> float:
        """Focal length in pixels (perspective projection)."""
        return 0.5 * self.height / float(np.tan(0.5 * np.deg2rad(self.fov_y_deg)))

    def directions(self) -> Float:
        """Return the (height, width, 3) unit world directions through the pixel centres."""
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        return self.unproject(np.stack([x, y], axis=-1))

    def unproject(self, pixels: Float) -> Float:
        """Return the unit world directions (..., 3) through image points (..., 2), in pixels."""
        if self.projection == "equirect":
            local = equirect_direction(pixels, self.width, self.height)
        else:
            local = np.stack(
                [
                    pixels[..., 0] - 0.5 * self.width,
                    0.5 * self.height - pixels[..., 1],
                    np.full(pixels.shape[:-1], -self.focal_px),
                ],
                axis=-1,
            )
            local = local / np.linalg.norm(local, axis=-1, keepdims=True)
        return local @ self.world_from_view.T

    def project(self, points: Float) -> Float:
        """Return the image points (..., 2), in pixels, of world points; NaN behind the camera."""
        local = points @ self.world_from_view
        if self.projection == "equirect":
            return equirect_pixel(local, self.width, self.height)
        depth = np.where(local[..., 2] < 0.0, -local[..., 2], np.nan)
        return np.stack(
            [
                0.5 * self.width + self.focal_px * local[..., 0] / depth,
                0.5 * self.height - self.focal_px * local[..., 1] / depth,
            ],
            axis=-1,
        )

    @property
    def pixel_angle(self) -> float:
        """Angle of a pixel in the middle of the view, radians."""
        return np.pi / self.height if self.projection == "equirect" else 1.0 / self.focal_px

    def kernel_constants(self) -> NDArray[np.float32]:
        """Return the (16,) float32 constants of `cl/lib/gbuffer/view.h`.

        They are the rows of the rotation, focal length, centre, size and an equirect flag.
        """
        size = (self.width, self.height)
        centre = (0.5 * self.width, 0.5 * self.height)
        rotation = self.world_from_view.ravel().tolist()
        equirect = float(self.projection == "equirect")
        return np.array([*rotation, self.focal_px, *centre, *size, equirect, 0.0], np.float32)
