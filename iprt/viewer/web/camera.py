"""viser's camera at the capture centre: from a view, and back.

The scene that the browser draws lies around the capture centre, along the axes of the world.
viser's camera circles a point; that point is the capture centre, at no distance to speak of.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.geometry.camera import View

Float = NDArray[np.float64]

ORBIT_M = 1e-4
"""Distance of the camera from the point that it circles: a pixel's hundredth at a metre."""


def rotation(wxyz: Float) -> Float:
    """(3, 3) of a unit quaternion w, x, y, z."""
    matrix: Float = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
    return matrix


def quaternion(matrix: Float) -> Float:
    """(4,) unit quaternion w, x, y, z of a rotation (3, 3)."""
    return np.roll(Rotation.from_matrix(matrix).as_quat(), 1)


def camera_of(view: View) -> Float:
    """(3, 3) rotation of viser's camera axes (right, down, forward) to the world."""
    return view.world_from_view @ np.diag([1.0, -1.0, -1.0])


def position_of(view: View) -> Float:
    """Where viser's camera is to be, that looks at the origin."""
    return -ORBIT_M * camera_of(view)[:, 2]


def look_of(view: View, wxyz: Float, fov_y: float) -> View:
    """The view that viser's camera has; field of view in radians."""
    matrix = rotation(wxyz)
    right, forward = matrix[:, 0], matrix[:, 2]
    # By the axis to the right, which is level and so defines the yaw straight up and down, too.
    yaw = np.rad2deg(np.arctan2(right[2], right[0]))
    pitch = np.rad2deg(np.arctan2(forward[1], np.hypot(forward[0], forward[2])))
    return replace(
        view,
        yaw_deg=float(yaw),
        pitch_deg=float(pitch),
        fov_y_deg=float(np.rad2deg(fov_y)),
        projection="perspective",
    )
