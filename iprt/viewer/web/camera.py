"""Conversion between views and viser's camera at the capture centre.

The browser's scene is centred on the capture centre, in the axes of the world. viser's camera
orbits a point. That point is the capture centre, at a negligible distance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.geometry.camera import View

Float = NDArray[np.float64]

ORBIT_M = 1e-4
"""Distance of the camera from its orbit centre; at a metre, a hundredth of a pixel."""


def rotation(wxyz: Float) -> Float:
    """Return the (3, 3) rotation of a unit quaternion w, x, y, z."""
    matrix: Float = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
    return matrix


def quaternion(matrix: Float) -> Float:
    """Return the (4,) unit quaternion w, x, y, z of a rotation (3, 3)."""
    return np.roll(Rotation.from_matrix(matrix).as_quat(), 1)


def camera_of(view: View) -> Float:
    """Return the (3, 3) rotation from viser's camera axes (right, down, forward) to the world."""
    return view.world_from_view @ np.diag([1.0, -1.0, -1.0])


def position_of(view: View) -> Float:
    """Return the position of viser's camera, which looks at the origin."""
    return -ORBIT_M * camera_of(view)[:, 2]


def look_of(view: View, wxyz: Float, fov_y: float) -> View:
    """Return the view of viser's camera; the field of view is in radians."""
    matrix = rotation(wxyz)
    right, forward = matrix[:, 0], matrix[:, 2]
    # The level right axis defines the yaw even when looking straight up or down.
    yaw = np.rad2deg(np.arctan2(right[2], right[0]))
    pitch = np.rad2deg(np.arctan2(forward[1], np.hypot(forward[0], forward[2])))
    return replace(
        view,
        yaw_deg=float(yaw),
        pitch_deg=float(pitch),
        fov_y_deg=float(np.rad2deg(fov_y)),
        projection="perspective",
    )
