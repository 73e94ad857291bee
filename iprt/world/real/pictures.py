"""Panorama pictures on the device, and their flux."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.geometry.equirect import texel_polar_angles
from iprt.world.real.surfaces import band_rows, bands

STRIP = constant("world/real/pictures.cl", "STRIP")


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


@dataclass
class Picture:
    """A picture of the panorama on the device.

    Attributes
    ----------
    name : str
        Name of its buffer.
    texels : (H, W, 3) float32 or None
        None: nothing was loaded.
    loaded : bool
        Whether `texels` holds a picture.
    """

    name: str
    texels: cla.Array | None
    loaded: bool = False


class PictureLoader:
    """Loader of pictures that also computes their flux (`cl/world/real/pictures.cl`).

    Parameters
    ----------
    device : ComputeDevice
    width, height : int
    share : bool
        Where the device shares the host's memory, pictures stay there without a map, and occupy
        it as long as they are loaded. Otherwise they are copied.
    """

    def __init__(self, device: ComputeDevice, width: int, height: int, *, share: bool) -> None:
        self._device = device
        self._width, self._height = width, height
        self._share = share and device.is_cpu
        self._band = height if self._share else band_rows(height, width)
        self._strips = -(-width // STRIP)
        if not self._share:
            self._color = device.empty("panorama.decoded", (self._band, width, 3))
        self._sums = device.empty("panorama.sums", (height, self._strips, 4))
        self._map = device.zeros("panorama.color map", (3, 4))
        self._load = device.kernel("world/real/pictures.cl", "load_texels").fixed(
            width=width, rows=self._band, sums=self._sums
        )

    def picture(self, name: str) -> Picture:
        """Return a picture without contents."""
        shape = self._height, self._width, 3
        return Picture(name, None if self._share else self._device.empty(name, shape))

    def load(
        self,
        picture: Picture,
        values: NDArray[np.float32],
        color_map: NDArray[np.float64] | None = None,
    ) -> None:
        """Load `values` (H, W, 3), mapped by `color_map` (3, 3), into a picture."""
        before = picture.texels if picture.loaded else None
        picture.loaded = True
        if not self._share:
            self._copy(picture, values, color_map, before)
            return
        assert color_map is None, "a map would change the host's picture"
        picture.texels = self._device.share(picture.name, values)
        self._load(
            (self._strips, self._height),
            first=0,
            done=0,
            color=picture.texels,
            map=None,
            before=before,
            texels=None,
        )

    def _copy(
        self,
        picture: Picture,
        values: NDArray[np.float32],
        color_map: NDArray[np.float64] | None,
        before: cla.Array | None,
    ) -> None:
        device = self._device
        if color_map is not None:
            rows = np.zeros((3, 4), np.float32)
            rows[:, :3] = color_map
            device.write(self._map, rows)
        end = 0
        for first in bands(self._height, self._width):
            done, end = end - first, first + self._band
            device.write(self._color, values[first : first + self._band])
            self._load(
                (self._strips, self._band),
                first=first,
                done=done,
                color=self._color,
                map=None if color_map is None else self._map,
                before=before,
                texels=picture.texels,
            )

    def flux(self) -> Flux:
        """Wait for the device, and return the flux of the last loaded picture."""
        sums = self._device.read(self._sums).sum(axis=1, dtype=np.float64)
        rows = np.sin(texel_polar_angles(self._height))
        apart, larger, total, _ = rows @ sums
        return Flux(
            mean=float(total / (3.0 * self._width * rows.sum())),
            change=float(apart / larger) if larger > 0.0 else 0.0,
        )
