"""Motion of the 360° camera since the previous frame, on the device."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.pose import camera_motion

STILL = np.eye(4)[:3]
"""Motion (3, 4) of a static camera."""


class CameraMotion:
    """Motion of the capture centre between view frames, where a video has poses.

    Attributes
    ----------
    rows : (12,) float32
        Affine map, row by row, from the axes of the frame's capture centre to the previous
        frame's: `cl/lib/gbuffer/camera.h`.
    """

    def __init__(self, device: ComputeDevice, pose: NDArray[np.float64]) -> None:
        self._device = device
        self._before = pose
        self._held = STILL
        self.rows = device.upload("camera motion", STILL.astype(np.float32).ravel())

    def step(self, pose: NDArray[np.float64]) -> bool:
        """Begin a view frame with the camera at (4, 4) `pose`; return whether `rows` changed."""
        motion = camera_motion(self._before, pose)
        self._before = pose
        if np.array_equal(motion, self._held):
            return False
        self._device.write(self.rows, motion.astype(np.float32).ravel())
        self._held = motion
        return True
