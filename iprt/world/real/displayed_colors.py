"""Displayed colors where lights were clipped, on the device."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla

from iprt.device.block import Block, Floats, Uints, when
from iprt.device.compute import ComputeDevice
from iprt.footage.clipped_texels import ClippedTexels


@dataclass(kw_only=True)
class ShownArgs(Block):
    """Displayed picture of the panorama (`cl/lib/world/real/panorama.h`).

    Attributes
    ----------
    color : (H, W, 3) float32
    clipped : uint32 or None
        `ClippedTexels.words()`; None: no texel is clipped.
    clipped_color : (N + 1, 3) float32 or None
        Displayed colors of the clipped texels.
    rest : (H, W, 3) float32
        Part of `color` that is not shown. `color` itself, which kernels replace: all is shown. It
        is no null pointer, as rusticl loads through pointers in branches that are not taken.
    """

    color: Floats
    clipped: Uints = when("CLIPPED")
    clipped_color: Floats = when("CLIPPED")
    rest: Floats = when("", outer="layer_shown_color")


class ShownTexels:
    """Texels whose displayed color differs from the radiance for rays.

    They take a quarter of a byte per texel of the panorama, and a color for each of them
    (`cl/lib/world/real/panorama.h`).

    Parameters
    ----------
    width, height : int
        Size of the panorama.
    """

    def __init__(self, device: ComputeDevice, width: int, height: int) -> None:
        self._device, self._count = device, width * height
        self._words: cla.Array | None = None
        self._colors: cla.Array | None = None

    def shown(self, color: cla.Array) -> ShownArgs:
        """Return the displayed picture; `color` is `Panorama.color`."""
        return ShownArgs(color=color, clipped=self._words, clipped_color=self._colors)

    def load(self, clipped: ClippedTexels | None) -> None:
        """Load the texels of a frame; None: it has none."""
        self._words = self._colors = None
        if clipped is None:
            return
        # Kernels load a vector of four, past the last color too.
        colors = np.concatenate([clipped.color, np.zeros((1, 3), np.float32)])
        self._words = self._device.share("panorama.clipped", clipped.words(self._count))
        self._colors = self._device.share("panorama.clipped color", colors)
