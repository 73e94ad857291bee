"""The layout of buffers that live on the view: padded planes, one per channel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

PAD = 32
"""Border in pixels: the reach of the widest à-trous level (two taps of stride 16)."""


@dataclass(frozen=True)
class PlaneLayout:
    """Shape of a stack of planes for a view of `width` x `height` pixels."""

    width: int
    height: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height: kernels are enqueued over them."""
        return self.width, self.height

    def arguments(self) -> dict[str, int]:
        """`width` and `height` of kernels that work on these planes."""
        return {"width": self.width, "height": self.height}

    def shape(self, channels: int) -> tuple[int, int, int]:
        """(channels, height + 2 PAD, width + 2 PAD), what `cl/lib/gbuffer/planes.h` indexes."""
        return (channels, self.height + 2 * PAD, self.width + 2 * PAD)

    def interior(self, planes: NDArray[np.generic]) -> NDArray[np.generic]:
        """(channels, height, width) view of padded planes, without the border."""
        return planes[..., PAD:-PAD, PAD:-PAD]

    def image(self, planes: NDArray[np.generic], channels: slice) -> NDArray[np.float32]:
        """Some of padded planes: (H, W) of one, else (H, W, C); without the border."""
        image = self.interior(planes)[channels].astype(np.float32)
        return np.ascontiguousarray(image[0] if len(image) == 1 else np.moveaxis(image, 0, -1))

    def padded(self, image: NDArray[np.generic]) -> NDArray[np.generic]:
        """Planes (C, height + 2 PAD, width + 2 PAD) from an image (C, height, width), border 0."""
        return np.pad(image, [(0, 0), (PAD, PAD), (PAD, PAD)])
