"""Relighting ratio of real surfaces (IPRT, Eq. 2)."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.passes.guide import Guide, plane_defines

BLACK = 1e-6
"""E_R up to this fraction of the scene's radiance scale is black: its ratio is noise."""


class Relight:
    """Divides E_RV by E_R.

    Attributes
    ----------
    ratio : (H * W, 4) float32
        Factor per colour of the real layer's radiance, in [0, 4]; row by row, without border. 1
        exactly where E_R and E_RV are equal, E_R is black or not finite, or no surface is lit.
    """

    def __init__(self, device: ComputeDevice, guide: Guide) -> None:
        self._device = device
        self._guide = guide
        self._kernel = device.kernel("relight.cl", "relight", plane_defines())
        pixels = guide.layout.width * guide.layout.height
        self.ratio = device.empty("relighting ratio", (pixels, 4))

    def run(self, signal: cla.Array, colour: cla.Array, *, scale: float) -> None:
        """Fill `ratio`.

        Parameters
        ----------
        signal : 6 planes, E_R and E_RV over π
        colour : 3 planes, radiance of the real layer, L_cam
        scale : float
            The scene's mean radiance.
        """
        width, height = self._guide.layout.width, self._guide.layout.height
        with self._device.profile.section("relight"):
            self._kernel(
                (width, height),
                self._guide.current,
                signal,
                colour,
                self.ratio,
                BLACK * scale,
                width,
                height,
            )
