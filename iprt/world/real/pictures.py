"""Panorama pictures on the device, and their flux."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.geometry.equirect import texel_polar_angles
from iprt.world.real.surfaces import band_rows, bands

STRIP = constant("lib/world/real/strips.h", "STRIP")
"""Texels of a row per work item."""
BLOCK = constant("world/real/pictures.cl", "BLOCK")
"""Rows whose sums are added before the host reads them."""


@dataclass(frozen=True)
class Flux:
    """Light that a panorama sends to its centre.

    Attributes
    ----------
    mean : float
        Radiance over the sphere and the three channels.
    change : float
        Relative difference from the previous picture, in [0, 1].
    """

    mean: float
    change: float


class PictureLoader:
    """Loader of a frame's pictures, with their flux (`cl/world/real/pictures.cl`).

    Parameters
    ----------
    device : ComputeDevice
    width, height : int
    share : bool
        Pictures stay in the host's memory, and occupy it until the next frame's are loaded.
        Otherwise they are copied.
    color_map : bool
        Frames may have a map.

    Attributes
    ----------
    color : (H, W, 3) float32 or None
        `Frame.color`; None: nothing was loaded.
    radiance : (H, W, 3) float32 or None
        `Frame.radiance`; `color` itself without a map.
    sums : (H, strips, 4) float32
        By strips of `STRIP` texels; w: 0 where `radiance` is the previous frame's, else 1.
    """

    def __init__(
        self, device: ComputeDevice, width: int, height: int, *, share: bool, color_map: bool
    ) -> None:
        self._device = device
        self._width, self._height = width, height
        self._share = share
        self._band = height if share else band_rows(height, width)
        self._strips = -(-width // STRIP)
        texels = (height, width, 3)
        self.color: cla.Array | None = None
        self.radiance: cla.Array | None = None
        if not share:
            self._staging = device.empty("panorama.decoded", (self._band, width, 3))
            self._stored = device.empty("panorama.color", texels)
        if color_map:
            self._mapped = device.empty("panorama.radiance", texels)
        self.sums = device.empty("panorama.sums", (height, self._strips, 4))
        self._map = device.zeros("panorama.color map", (3, 4))
        self._blocks = device.empty("panorama.block sums", (-(-height // BLOCK), self._strips, 4))
        self._weight = np.sin(texel_polar_angles(height))
        file, wide = "world/real/pictures.cl", {"WIDE": device.wide}
        self._load = device.kernel(file, "load_texels", wide).fixed(
            width=width, rows=self._band, sums=self.sums
        )
        self._sum = device.kernel(file, "sum_strips", wide).fixed(
            strips=self._strips,
            rows=height,
            weight=device.upload("panorama.row weights", self._weight.astype(np.float32)),
            sums=self.sums,
            blocks=self._blocks,
        )
        self._read: Callable[[], NDArray[np.float32]] | None = None

    def load(
        self, values: NDArray[np.float32], color_map: NDArray[np.float64] | None = None
    ) -> None:
        """Load `values` (H, W, 3), and the values that `color_map` (3, 3) maps them to."""
        device, before = self._device, self.radiance
        if color_map is not None:
            rows = np.zeros((3, 4), np.float32)
            rows[:, :3] = color_map
            device.write(self._map, rows)
        if self._share:
            color = self.color = device.share("panorama.color", values)
            texels, stored = (None if color_map is None else self._mapped), None
        else:
            color, self.color = self._staging, self._stored
            texels, stored = self.color, None
            if color_map is not None:
                texels, stored = self._mapped, self.color
        self.radiance = self.color if color_map is None else self._mapped
        end = 0
        for first in [0] if self._share else bands(self._height, self._width):
            done, end = end - first, first + self._band
            if not self._share:
                device.write(color, values[first : first + self._band])
            self._load(
                (self._strips, self._band),
                first=first,
                done=done,
                color=color,
                map=None if color_map is None else self._map,
                before=before,
                texels=texels,
                stored=stored,
            )

        self._sum(self._blocks.shape[1::-1])
        self._read = device.fetch(self._blocks)

    def flux(self) -> Flux:
        """Return the flux of the last loaded picture; waits for its sums, not for later work."""
        assert self._read is not None, "no picture was loaded"
        apart, larger, total, _ = self._read().sum(axis=(0, 1), dtype=np.float64)
        return Flux(
            mean=float(total / (3.0 * self._width * self._weight.sum())),
            change=float(apart / larger) if larger > 0.0 else 0.0,
        )
