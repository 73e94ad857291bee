"""Displayed colours where lights were clipped, on the device."""

from __future__ import annotations

from typing import Any

import numpy as np

from iprt.device.compute import ComputeDevice
from iprt.footage.clipped_texels import ClippedTexels

NOTHING_CLIPPED: dict[str, Any] = {}
"""`ShownTexels.arguments` where the displayed picture equals the radiance for rays."""


class ShownTexels:
    """Texels whose displayed colour differs from the radiance for rays.

    They take a quarter of a byte per texel of the panorama, and a colour for each of them
    (`cl/lib/world/real/panorama.h`).

    Parameters
    ----------
    width, height : int
        Size of the panorama.

    Attributes
    ----------
    arguments : dict
        Arguments of kernels that show the picture, besides `Panorama.color`.
    """

    def __init__(self, device: ComputeDevice, width: int, height: int) -> None:
        self._device, self._count = device, width * height
        self.arguments = NOTHING_CLIPPED

    def load(self, clipped: ClippedTexels | None) -> None:
        """Load the texels of a frame; None: it has none."""
        self.arguments = NOTHING_CLIPPED
        if clipped is None:
            return
        # Kernels load a vector of four, past the last colour too.
        colors = np.concatenate([clipped.color, np.zeros((1, 3), np.float32)])
        self.arguments = {
            "panorama_clipped": self._device.share("panorama.clipped", clipped.words(self._count)),
            "panorama_clipped_color": self._device.share("panorama.clipped color", colors),
        }
