"""Poses of a moving 360° camera.

Device data is in the axes of the current frame's capture centre. A pose is the rigid transform from
there to the world. A pose therefore transforms objects and views, not the device data.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance

Float = NDArray[np.float64]


@dataclass(frozen=True)
class TurnedView(View):
    """A view with yaw and pitch in world axes, expressed in a rotated capture centre's axes.

    Attributes
    ----------
    capture : tuple of 9 float
        Rows of the rotation from the world's axes to the capture centre's.
    """

    capture: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

    @cached_property
    def world_from_view(self) -> Float:
        """(3, 3) rotation from view space to the capture centre's axes."""
        return np.reshape(self.capture, (3, 3)) @ super().world_from_view


def view_from(view: View, pose: Float | None) -> View:
    """Return a world view in the axes of a capture centre with this (4, 4) pose.

    Equirect views show the capture centre's own axes.
    """
    if pose is None or view.projection == "equirect" or np.array_equal(pose[:3, :3], np.eye(3)):
        return view
    capture = tuple(float(value) for value in pose[:3, :3].T.ravel())
    return TurnedView(**asdict(view), capture=capture)


def seen_from(instances: Iterable[Instance], pose: Float | None) -> tuple[Instance, ...]:
    """Return the world's objects in the axes of a capture centre with this (4, 4) pose."""
    if pose is None or np.array_equal(pose, np.eye(4)):
        return tuple(instances)
    capture = inverse_pose(pose)
    return tuple(replace(i, to_world=capture @ i.to_world) for i in instances)


def inverse_pose(pose: Float) -> Float:
    """Return the (4, 4) transform from the world to the axes of a capture centre with this pose."""
    inverse = np.eye(4)
    inverse[:3, :3] = pose[:3, :3].T
    inverse[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return inverse


def camera_motion(before: Float | None, now: Float | None) -> Float:
    """Return the (3, 4) map of points from this capture centre's axes to the previous one's.

    It is exactly the identity if both poses, (4, 4), are equal or None.

    Raises
    ------
    ValueError
        Only one of them is None: the motion of the camera is unknown.
    """
    if (before is None) != (now is None):
        raise ValueError("either all frames of a video have poses or none")
    if before is None or now is None or np.array_equal(before, now):
        return np.eye(4)[:3]
    return (inverse_pose(before) @ now)[:3]
