"""Rotation of panoramas about the vertical by `yaw_offset_deg`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]


def turned_color(color: Picture, yaw_deg: float) -> Picture:
    """Rotate color to the right, towards +X: azimuth a moves to a + yaw.

    Color is interpolated linearly between columns.
    """
    columns = yaw_deg / 360.0 * color.shape[1]
    whole = int(np.floor(columns))
    part = np.float32(columns - whole)
    if whole % color.shape[1]:
        color = np.roll(color, whole, axis=1)
    if part > 1e-4:
        color = (1 - part) * color + part * np.roll(color, 1, axis=1)
    return color


def turned_geometry(
    depth: Picture, normal: Picture | None, yaw_deg: float
) -> tuple[Picture, Picture | None]:
    """Rotate depth and normals like `turned_color`, by the nearest whole number of columns.

    Interpolation would blur depth edges. The vectors of normals rotate, too.
    """
    nearest = int(np.floor(yaw_deg / 360.0 * depth.shape[1] + 0.5))
    if yaw_deg == 0.0:
        return depth, normal
    if normal is not None and yaw_deg % 360.0 != 0.0:
        angle = np.deg2rad(yaw_deg)
        cos, sin = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        x, y, z = np.moveaxis(np.roll(normal, nearest, axis=1), -1, 0)
        normal = np.stack([cos * x - sin * z, y, sin * x + cos * z], axis=-1)
    return np.roll(depth, nearest, axis=1), normal
