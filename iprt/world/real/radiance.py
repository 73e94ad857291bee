"""Pictures of the panorama on the device, and what their flux is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.files.kernel_source import constant
from iprt.world.real.surfaces import band_rows, bands

STRIP = constant("world/real/radiance.cl", "STRIP")


@dataclass(frozen=True)
class Flux:
    """Light that a panorama sends to its centre.

    Attributes
    ----------
    mean : float
        Radiance over the sphere and the three channels.
    change : float
        Share by which it differs from that of the picture before, in [0, 1].
    """

    mean: float
    change: float


class PictureLoader:
    """Makes four floats a texel of the three of a picture (`cl/world/real/radiance.cl`)."""

    def __init__(self, device: ComputeDevice, width: int, height: int) -> None:
        self._device = device
        self._width, self._height = width, height
        self._band = band_rows(height)
        self._strips = -(-width // STRIP)
        self._color = device.empty("panorama.decoded", (self._band, width, 3))
        self._sums = device.empty("panorama.sums", (height, self._strips, 4))
        self._map = device.zeros("panorama.color map", (3, 4))
        self._load = device.kernel("world/real/radiance.cl", "load_texels").fixed(
            width=width, rows=self._band, color=self._color, sums=self._sums
        )

    def load(
        self,
        texels: cla.Array,
        picture: NDArray[np.float32],
        color_map: NDArray[np.float64] | None = None,
        *,
        fresh: bool,
    ) -> None:
        """Fill `texels` (H, W, 4) with a picture (H, W, 3), mapped by `color_map` (3, 3).

        `fresh`: it holds no picture yet.
        """
        device = self._device
        if color_map is not None:
            rows = np.zeros((3, 4), np.float32)
            rows[:, :3] = color_map
            device.write(self._map, rows)
        end = 0
        for first in bands(self._height):
            done, end = end - first, first + self._band
            with device.profile.section("upload"):
                device.write(self._color, picture[first : first + self._band])
                self._load(
                    (self._strips, self._band),
                    first=first,
                    done=done,
                    fresh=fresh,
                    map=None if color_map is None else self._map,
                    texels=texels,
                )

    def flux(self) -> Flux:
        """Wait for the device, and return the flux of the picture that was loaded last."""
        sums = self._device.read(self._sums).sum(axis=1, dtype=np.float64)
        rows = np.sin((np.arange(self._height) + 0.5) / self._height * np.pi)
        apart, larger, total, _ = rows @ sums
        return Flux(
            mean=float(total / (3.0 * self._width * rows.sum())),
            change=float(apart / larger) if larger > 0.0 else 0.0,
        )
