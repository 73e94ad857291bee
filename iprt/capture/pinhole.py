"""Pinhole cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Float = NDArray[np.float32]


@dataclass(frozen=True)
class Pinhole:
    """A pinhole camera, in pixels; the centre of the first pixel is (0, 0).

    Attributes
    ----------
    width, height : int
        Size of the pictures.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    def resized(self, width: int, height: int) -> Pinhole:
        """Return the camera of the same view for pictures of another size."""
        x, y = width / self.width, height / self.height
        return Pinhole(
            self.fx * x,
            self.fy * y,
            (self.cx + 0.5) * x - 0.5,
            (self.cy + 0.5) * y - 0.5,
            width,
            height,
        )

    def reduced(self, step: int) -> Pinhole:
        """Return the camera of pictures whose pixels are blocks of `step` x `step` pixels.

        Rows and columns beyond the last whole block are dropped.
        """
        width, height = self.width // step, self.height // step
        whole = Pinhole(self.fx, self.fy, self.cx, self.cy, width * step, height * step)
        return whole.resized(width, height)

    def rays(self) -> Float:
        """Return rays (H, W, 3) with z = 1 through the pixel centres, in OpenCV's axes."""
        y, x = np.indices((self.height, self.width), np.float32)
        return np.stack(
            [(x - self.cx) / self.fx, (y - self.cy) / self.fy, np.ones_like(x)], axis=-1
        ).astype(np.float32)

    def pixels(self, points: Float) -> tuple[Float, Float]:
        """Return columns and rows (...) of points (..., 3) ahead of the camera."""
        x, y, z = np.moveaxis(points, -1, 0)
        return self.fx * x / z + self.cx, self.fy * y / z + self.cy


def blocks(values: NDArray[np.generic], step: int) -> NDArray[np.generic]:
    """Return (H', step, W', step, ...) whole blocks of values (H, W, ...)."""
    height, width = values.shape[0] // step, values.shape[1] // step
    whole = values[: height * step, : width * step]
    return whole.reshape(height, step, width, step, *values.shape[2:])


def sampled(values: Float, column: Float, row: Float) -> Float:
    """Interpolate values (H, W, C) between pixel centres, clamped at the edges, to (N, C)."""
    at = np.stack([row.ravel(), column.ravel()])
    channels = [
        ndimage.map_coordinates(channel, at, order=1, mode="nearest")
        for channel in np.moveaxis(values, -1, 0)
    ]
    return np.stack(channels, axis=-1).reshape(*row.shape, values.shape[-1])
