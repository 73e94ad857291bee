"""Coarse versions of frames, and their overlap when projected into each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.capture.pinhole import Pinhole, blocks, sampled

COLUMNS = 64
"""Most cells along a row."""
SAME_SURFACE = 0.1
"""Largest relative difference of depths in a cell of one surface."""
AGREE_M, AGREE = 0.02, 0.03
"""Absolute and relative tolerance of depths of one surface; their sum counts."""

Float = NDArray[np.float32]
Matrix = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Glance:
    """A frame downsampled to a few cells.

    Attributes
    ----------
    camera : Pinhole
        Camera of the cells.
    depth : (H, W) float32
        Metres along +Z; 0 at holes and edges.
    color : (H, W, 3) float32
        Mean linear radiance; NaN where it may be clipped.
    """

    camera: Pinhole
    depth: Float
    color: Float

    @classmethod
    def of(cls, depth: Float, color: Float, clipped: Mask, camera: Pinhole) -> Glance:
        """Downsample a frame, given as arrays (H, W), (H, W, 3), (H, W) as in `RgbdFrame`."""
        step = max(1, -(-depth.shape[1] // COLUMNS))
        parts = np.asarray(blocks(depth, step))
        there = parts > 0.0
        count = there.sum(axis=(1, 3))
        mean = parts.sum(axis=(1, 3)) / np.maximum(count, 1)
        nearest = np.where(there, parts, np.inf).min(axis=(1, 3))
        one = (parts.max(axis=(1, 3)) - nearest <= SAME_SURFACE * mean) & (2 * count >= step * step)
        colors = np.asarray(blocks(color, step)).mean(axis=(1, 3))
        unclipped: Mask = ~np.any(blocks(clipped, step), axis=(1, 3))
        return cls(
            camera.reduced(step),
            np.where(one, mean, 0.0).astype(np.float32),
            np.where(unclipped[..., None], colors, np.nan).astype(np.float32),
        )


@dataclass(frozen=True)
class Overlap:
    """The cells of a glance that project into another one with known depth.

    Attributes
    ----------
    cell : (N,) intp
        Flat indices.
    column, row : (N,) float32
        Positions in the other glance.
    z : (N,) float32
        Expected depth in the other camera.
    seen : (N,) float32
        Depth of the other glance there.
    """

    cell: Indices
    column: Float
    row: Float
    z: Float
    seen: Float

    @property
    def agree(self) -> Mask:
        """(N,) bool: both glances see the same surface."""
        return np.asarray(np.abs(self.z - self.seen) < AGREE_M + AGREE * self.seen)

    @property
    def seen_through(self) -> int:
        """Number of cells that contradict the other glance, because it sees through them."""
        return int((self.z < self.seen)[~self.agree].sum())


def overlap(glance: Glance, other: Glance, turn: Matrix) -> Overlap:
    """Project a glance into another one.

    Parameters
    ----------
    turn : (4, 4) float64
        Transform from the first camera's axes to the other's.
    """
    cell = np.flatnonzero(glance.depth)
    points = glance.camera.rays().reshape(-1, 3)[cell] * glance.depth.ravel()[cell, None]
    points = (points @ turn[:3, :3].T + turn[:3, 3]).astype(np.float32)
    ahead = points[:, 2] > AGREE_M
    cell, points = cell[ahead], points[ahead]
    column, row = other.camera.pixels(points)
    height, width = other.depth.shape
    inside = (np.abs(column - (width - 1) / 2) <= width / 2) & (
        np.abs(row - (height - 1) / 2) <= height / 2
    )
    cell, points, column, row = cell[inside], points[inside], column[inside], row[inside]
    nearness = 1.0 / np.where(other.depth > 0.0, other.depth, np.inf)
    known = np.stack([nearness, other.depth > 0.0], axis=-1).astype(np.float32)
    near, there = sampled(known, column, row).T
    whole = there > 0.999
    return Overlap(
        cell[whole], column[whole], row[whole], points[whole, 2], there[whole] / near[whole]
    )
