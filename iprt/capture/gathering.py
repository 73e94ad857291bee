"""A sequence's frames into a cloud, one by one: what was wrong is removed, colours are compensated.

Sections 4 and 5 of *Natural Environment Illumination*.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from iprt.capture.cloud import Cloud, Samples
from iprt.capture.planes import fit_planes, pixel_rays
from iprt.capture.sequence import CameraTable, Picture
from iprt.footage.color_fit import Pairs

SEEN_THROUGH_M, SEEN_THROUGH = 0.1, 0.05
"""A sample nearer than the depth picture by both, absolutely and relatively, is not there."""
AGREE_M, AGREE = 0.02, 0.03
"""Depths of one surface differ by less than the sum."""
MIN_PAIRS, MIN_SHARE = 200, 0.02
"""With fewer samples in sight, absolutely or by the picture's pixels, colours are not compared."""
CELLS = 40
"""Cells along each side of a picture, whose mean colours are compared: pixels alone are noisy."""
MIN_CELLS = 20
DARK = 0.02
"""Radiance below which colours are uncertain, as a share of the median of a frame."""
MAX_GRADIENT = 0.2
"""Pixels whose neighbours differ by more of their brightness may be matched to what is beside."""
REGION = 5
"""Cells a side of the regions over which a map's errors are told apart."""
SURE_SCALE = 0.01
"""Relative standard error up to which a scale per channel is believed, where no map is found."""
SAME_COLORS = 0.002
"""A map that leaves less than this relative error stays as it is."""

Matrix = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class _Sight:
    """Samples of the cloud in a frame: their slots, pixels and depth."""

    slot: Indices
    row: Indices
    column: Indices
    z: NDArray[np.float32]


class Gathering:
    """A cloud that grows by frames.

    Parameters
    ----------
    camera : CameraTable
    compensate : bool
        Bring all frames to the colours of the first.
    seed : int
        Of the random numbers.

    Attributes
    ----------
    cloud : Cloud
    removed : int
        Samples that later frames saw through.
    left_out : int
        Frames whose colours could not be compared with what was seen before.
    """

    def __init__(self, camera: CameraTable, *, compensate: bool = True, seed: int = 0) -> None:
        self.cloud = Cloud(seed)
        self.removed = self.left_out = 0
        self.color_map: Matrix = np.eye(3)
        self._camera, self._compensate = camera, compensate
        self._empty = True

    def add(self, picture: Picture, pose: Matrix) -> None:
        """Add a frame with a (4, 4) transform from the camera's axes to the scene's."""
        camera = self._camera
        rays = pixel_rays(picture.depth.shape, camera.fx, camera.fy, camera.cx, camera.cy)
        depth, normal = fit_planes(picture.depth, rays)
        sight = self._sight(pose, depth.shape)
        comparable = self._compensated(picture, depth, sight)
        self._carve(sight, picture.depth)
        if not comparable:
            self.left_out += 1
            return
        row, column = np.nonzero(depth)
        z = depth[row, column]
        turn, offset = pose[:3, :3].astype(np.float32), pose[:3, 3].astype(np.float32)
        color = picture.color[row, column] @ self.color_map.T.astype(np.float32)
        self.cloud.insert(
            Samples(
                np.asarray((rays[row, column] * z[:, None]) @ turn.T + offset, np.float32),
                np.maximum(color, np.float32(0.0)),
                normal[row, column] @ turn.T,
                z * np.float32(0.5 / min(camera.fx, camera.fy)),
                picture.clipped[row, column],
            )
        )
        self._empty = self._empty and not len(z)

    def _sight(self, pose: Matrix, shape: tuple[int, int]) -> _Sight:
        """All samples whose projections lie in the picture, hidden ones too."""
        camera, positions = self._camera, self.cloud.positions
        to_camera = pose[:3, :3].astype(np.float32)
        origin = (pose[:3, 3] @ pose[:3, :3]).astype(np.float32)
        z = positions @ to_camera[:, 2] - origin[2]
        slot = np.flatnonzero(z > 0.0)  # free slots are NaN
        z = z[slot]
        xy = positions[slot] @ to_camera[:, :2] - origin[:2]
        column = np.rint(camera.fx * xy[:, 0] / z + camera.cx)
        row = np.rint(camera.fy * xy[:, 1] / z + camera.cy)
        inside = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
        return _Sight(
            slot[inside], row[inside].astype(np.intp), column[inside].astype(np.intp), z[inside]
        )

    def _carve(self, sight: _Sight, depth: NDArray[np.float32]) -> None:
        """Remove the samples that the frame sees through."""
        # A pixel beside an edge may be of either side: the nearest of its neighbours counts.
        nearest = ndimage.minimum_filter(np.where(depth > 0.0, depth, np.inf), 3)
        nearest = np.where(depth > 0.0, nearest, 0.0)[sight.row, sight.column]
        gap = nearest - sight.z
        through = (gap > SEEN_THROUGH_M) & (gap > SEEN_THROUGH * nearest)
        self.cloud.remove(sight.slot[through])
        self.removed += int(through.sum())

    def _compensated(self, picture: Picture, depth: NDArray[np.float32], sight: _Sight) -> bool:
        """Find the map of this frame's colours to those of the first; whether there is one."""
        if self._empty or not self._compensate:
            return True
        brightness = picture.color.mean(axis=-1)
        dark = DARK * float(np.median(brightness))
        change = ndimage.maximum_filter(brightness, 3) - ndimage.minimum_filter(brightness, 3)
        even = (change < MAX_GRADIENT * brightness) & (brightness > dark)
        even &= ~ndimage.maximum_filter(picture.clipped, 3)
        seen_z = depth[sight.row, sight.column]
        same = (seen_z > 0.0) & even[sight.row, sight.column]
        same &= np.abs(sight.z - seen_z) < AGREE_M + AGREE * seen_z
        index = np.flatnonzero(same)
        enough = max(MIN_PAIRS, MIN_SHARE * depth.size)
        if len(index) < enough:
            return False
        there = self.cloud.at(sight.slot[index])
        row, column = sight.row[index], sight.column[index]
        usable = ~there.clipped & (there.color.mean(axis=1) > 0.0)
        row, column, color = row[usable], column[usable], there.color[usable]
        cell = row * CELLS // depth.shape[0] * CELLS + column * CELLS // depth.shape[1]
        count = np.bincount(cell, minlength=CELLS**2)
        used = np.flatnonzero(count >= max(1, enough // CELLS**2))
        if len(used) < MIN_CELLS:
            return False
        pairs = Pairs(
            _means(picture.color[row, column], cell, count)[used],
            _means(color, cell, count)[used],
            count[used].astype(np.float64),
            used // CELLS // REGION * CELLS + used % CELLS // REGION,
            dark * float(np.trace(self.color_map)) / 3.0,
        )
        found = pairs.fit()
        if found is None and pairs.scale_error() < SURE_SCALE:
            # Coarse pixels of textures match too roughly to tell more.
            found = np.diag(pairs.scale())
        if found is None:
            return False
        if pairs.left(self.color_map)[0] >= SAME_COLORS:
            self.color_map = found
        return True


def _means(color: NDArray[np.float32], cell: Indices, count: NDArray[np.integer]) -> Matrix:
    """(len(count), 3) mean colours of cells."""
    sums = [np.bincount(cell, channel, len(count)) for channel in color.T]
    return np.asarray(np.stack(sums, axis=1) / np.maximum(count, 1)[:, None])
