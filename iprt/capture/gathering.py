"""Accumulation of a sequence's frames in a cloud, and removal of wrong surfaces.

See section 5 of *Natural Environment Illumination*.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from iprt.capture.cloud import Cloud, Samples
from iprt.capture.depth_normals import fit_planes
from iprt.capture.pinhole import Pinhole
from iprt.capture.rgbd_sequence import RgbdFrame

SEEN_THROUGH_M, SEEN_THROUGH = 0.1, 0.05
"""Absolute and relative distance in front of the depth picture from which a sample is removed; both
must be exceeded."""
Matrix = NDArray[np.float64]


class Gathering:
    """A cloud that accumulates frames.

    Attributes
    ----------
    cloud : Cloud
    removed : int
        Number of samples that later frames saw through.
    """

    def __init__(self) -> None:
        self.cloud = Cloud()
        self.removed = 0

    def add(self, picture: RgbdFrame, pose: Matrix, *, shown: bool = True) -> None:
        """Add a frame.

        Parameters
        ----------
        pose : (4, 4) float64
            Transform from the camera's axes to the scene's.
        shown : bool
            Add the frame's surfaces; otherwise it only removes samples in its lines of sight.
        """
        self._carve(picture.depth, pose, picture.camera)
        if not shown:
            return
        rays = picture.camera.rays()
        depth, normal = fit_planes(picture.depth, rays)
        row, column = np.nonzero(depth)
        z = depth[row, column]
        turn, offset = pose[:3, :3].astype(np.float32), pose[:3, 3].astype(np.float32)
        self.cloud.insert(
            Samples(
                np.asarray((rays[row, column] * z[:, None]) @ turn.T + offset, np.float32),
                picture.color[row, column],
                normal[row, column] @ turn.T,
                z * np.float32(0.5 / min(picture.camera.fx, picture.camera.fy)),
                picture.clipped[row, column],
            )
        )

    def _carve(self, depth: NDArray[np.float32], pose: Matrix, camera: Pinhole) -> None:
        """Remove the samples that a frame sees through (space carving)."""
        positions = self.cloud.positions
        to_camera = pose[:3, :3].astype(np.float32)
        origin = (pose[:3, 3] @ pose[:3, :3]).astype(np.float32)
        z = positions @ to_camera[:, 2] - origin[2]
        slot = np.flatnonzero(z > 0.0)  # free slots are NaN
        z = z[slot]
        xy = positions[slot] @ to_camera[:, :2] - origin[:2]
        column = np.rint(camera.fx * xy[:, 0] / z + camera.cx)
        row = np.rint(camera.fy * xy[:, 1] / z + camera.cy)
        inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
        pixel = row[inside].astype(np.intp), column[inside].astype(np.intp)
        # A pixel at an edge may show either side, so the nearest of its neighbours counts.
        nearest = ndimage.minimum_filter(np.where(depth > 0.0, depth, np.inf), 3)
        nearest = np.where(depth > 0.0, nearest, 0.0)[pixel]
        gap = nearest - z[inside]
        through = (gap > SEEN_THROUGH_M) & (gap > SEEN_THROUGH * nearest)
        self.cloud.remove(slot[inside][through])
        self.removed += int(through.sum())
