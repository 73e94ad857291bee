"""Maps between a video frame's colors and the colors for rays, on the device."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice


class ColorMap:
    """`Frame.color_map` of the current frame, for `cl/lib/world/real/color_map.h`.

    Attributes
    ----------
    rows : (6, 4) float32 or None
        Rows of the map to the reference's colors, and of its inverse; None: no map.
    """

    def __init__(self, device: ComputeDevice) -> None:
        self._device = device
        self._buffer = device.zeros("color map", (6, 4))
        self.rows: cla.Array | None = None

    def load(self, color_map: NDArray[np.float64] | None) -> None:
        """Load another frame's invertible map (3, 3), or none."""
        self.rows = None
        if color_map is None:
            return
        maps = np.zeros((6, 4), np.float32)
        maps[:3, :3], maps[3:, :3] = color_map, np.linalg.inv(color_map)
        self._device.write(self._buffer, maps)
        self.rows = self._buffer
