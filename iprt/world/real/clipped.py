"""What the picture shows where lights were clipped, on the device."""

from __future__ import annotations

from typing import Any

import numpy as np

from iprt.device.compute import ComputeDevice
from iprt.footage.clipped_texels import ClippedTexels

NOTHING_CLIPPED: dict[str, Any] = {}
"""`ShownTexels.arguments` where the picture shows what rays find."""


class ShownTexels:
    """Texels that the picture shows otherwise than rays find them: a quarter of a byte a texel of
    the panorama, and the colours of those (`cl/lib/world/real/panorama.h`).

    Parameters
    ----------
    width, height : int
        Size of the panorama.

    Attributes
    ----------
    arguments : dict
        What kernels that show the picture take besides `Panorama.color`.
    """

    def __init__(self, device: ComputeDevice, width: int, height: int) -> None:
        self._device, self._count = device, width * height
        self.arguments = NOTHING_CLIPPED

    def load(self, clipped: ClippedTexels | None) -> None:
        """Go on to those of a frame; None: it has none."""
        self.arguments = NOTHING_CLIPPED
        if clipped is None:
            return
        # Kernels load a row for each texel, after the last of these too.
        colors = np.concatenate([clipped.color, np.zeros((1, 3), np.float32)])
        self.arguments = {
            "panorama_clipped": self._device.share("panorama.clipped", clipped.words(self._count)),
            "panorama_clipped_color": self._device.share("panorama.clipped color", colors),
        }
