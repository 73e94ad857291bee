"""Layout of view-space buffers: padded planes, one per channel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.geometry.camera import View

PAD = constant("lib/gbuffer/planes.h", "PLANE_PAD")
"""Border in pixels."""

WAY = constant("lib/gbuffer/planes.h", "PLANE_WAY")
SHIFT = constant("lib/gbuffer/planes.h", "PLANE_SHIFT")
"""Planes start `SHIFT` floats more than a multiple of `WAY` apart."""


@dataclass(frozen=True)
class PlaneLayout:
    """Shape of a stack of planes for a view of `width` x `height` pixels.

    Attributes
    ----------
    equirect : bool
        The view shows the whole panorama: its left and right edges are adjacent.
    """

    width: int
    height: int
    equirect: bool = False

    @classmethod
    def of(cls, view: View) -> Self:
        """Return the layout of a view's planes."""
        return cls(view.width, view.height, view.projection == "equirect")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, over which kernels are enqueued."""
        return self.width, self.height

    def arguments(self) -> dict[str, int]:
        """Return `width` and `height` of kernels for these planes, and `seam`.

        `seam` is the number of border columns that repeat the other side of the ±180° seam.
        """
        seam = PAD if self.equirect else 0
        return {"width": self.width, "height": self.height, "seam": seam}

    def shape(self, channels: int) -> tuple[int, int]:
        """Return the shape of planes: channels, and `plane_size` of `cl/lib/gbuffer/planes.h`."""
        pixels = (self.height + 2 * PAD) * (self.width + 2 * PAD)
        return channels, -(-pixels // WAY) * WAY + SHIFT

    def bordered(self, planes: NDArray[np.generic]) -> NDArray[np.generic]:
        """Return a (channels, height + 2 PAD, width + 2 PAD) view of planes."""
        rows, columns = self.height + 2 * PAD, self.width + 2 * PAD
        return planes[:, : rows * columns].reshape(-1, rows, columns)

    def interior(self, planes: NDArray[np.generic]) -> NDArray[np.generic]:
        """Return a (channels, height, width) view of planes, without the border."""
        return self.bordered(planes)[:, PAD:-PAD, PAD:-PAD]

    def image(self, planes: NDArray[np.generic], channels: slice) -> NDArray[np.float32]:
        """Return the image of some planes, (H, W) for one, else (H, W, C), without the border."""
        image = self.interior(planes)[channels].astype(np.float32)
        return np.ascontiguousarray(image[0] if len(image) == 1 else np.moveaxis(image, 0, -1))

    def padded(self, image: NDArray[np.generic]) -> NDArray[np.generic]:
        """Return planes of an image (channels, height, width), with a border of 0."""
        planes = np.zeros(self.shape(len(image)), image.dtype)
        self.interior(planes)[:] = image
        return planes


def row_items(device: ComputeDevice, dimensions: int, rows: int) -> tuple[int, ...]:
    """Return the work items of kernels that reduce rows (`cl/lib/gbuffer/row.h`)."""
    if device.wide:
        return (rows, 1)[:dimensions]
    first, *others = device.group_size(dimensions)[:2]
    return rows * first, *others
