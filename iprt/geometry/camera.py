"""Views and the two projections, both centred on the 360° capture centre.

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
    """One picture to render: where the camera at the capture centre looks, and how large.

    Attributes
    ----------
    width, height : int
        Pixels.
    yaw_deg : float
        Turns right, towards +X.
    pitch_deg : float
        Turns up.
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
        return replace(self, width=width, height=height)

    def reduced(self, scale: int) -> View:
        """The same picture with a pixel for every `scale` x `scale` pixels, the last ones in part.

        Perspective views of a size that `scale` does not divide show a little more at all sides.
        """
        width, height = -(-self.width // scale), -(-self.height // scale)
        half = 0.5 * height * scale / self.focal_px
        fov = float(np.rad2deg(2.0 * np.arctan(half)))
        return replace(self, width=width, height=height, fov_y_deg=fov)

    @cached_property
    def world_from_view(self) -> Float:
        """(3, 3) rotation that takes view-space to world-space directions; not to be changed."""
        yaw, pitch = np.deg2rad(self.yaw_deg), np.deg2rad(self.pitch_deg)
        cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
        turn = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
        return np.asarray(turn @ tilt)

    @property
    def focal_px(self) -> float:
        """Distance of the image plane in pixels (perspective)."""
        return 0.5 * self.height / float(np.tan(0.5 * np.deg2rad(self.fov_y_deg)))

    def directions(self) -> Float:
        """(height, width, 3) unit world directions through the pixel centres."""
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        return self.unproject(np.stack([x, y], axis=-1))

    def unproject(self, pixels: Float) -> Float:
        """Unit world directions (..., 3) through image points (..., 2), in pixels."""
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
        """Image points (..., 2), in pixels, of world points (..., 3); NaN behind the camera."""
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

    def kernel_constants(self) -> NDArray[np.float32]:
        """(16,) float32 for `cl/lib/gbuffer/view.h`: rotation rows, focal length, centre, size,
        and whether the projection is equirect.
        """
        size = (self.width, self.height)
        centre = (0.5 * self.width, 0.5 * self.height)
        rotation = self.world_from_view.ravel().tolist()
        equirect = float(self.projection == "equirect")
        return np.array([*rotation, self.focal_px, *centre, *size, equirect, 0.0], np.float32)
