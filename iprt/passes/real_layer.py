"""The real layer of the view: what the camera sees without the objects."""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.passes.guide import plane_defines
from iprt.passes.layout import PlaneLayout
from iprt.passes.panorama import Panorama


class RealLayer:
    """Resamples the panorama into the view.

    Attributes
    ----------
    color : 3 planes
        Linear radiance, L_cam of IPRT Eq. 2.
    normal, depth, id, motion : 3, 1, 1, 2 planes
        See `cl/resample.cl`.
    """

    def __init__(self, device: ComputeDevice, layout: PlaneLayout, *, equirect: bool) -> None:
        self._device = device
        self._layout = layout
        self._kernel = device.kernel(
            "resample.cl", "resample_panorama", plane_defines(equirect=equirect)
        )
        self.color = device.zeros("real color", layout.shape(3))
        self.normal = device.zeros("real normal", layout.shape(3))
        self.depth = device.zeros("real depth", layout.shape(1))
        self.id = device.zeros("real id", layout.shape(1))
        self.motion = device.zeros("real motion", layout.shape(2))

    def run(self, panorama: Panorama, view: cla.Array, previous: cla.Array) -> None:
        """Fill the planes; `view` and `previous` are `View.kernel_constants()` on the device."""
        width, height = self._layout.width, self._layout.height
        with self._device.profile.section("resample"):
            self._kernel(
                (width, height),
                width,
                height,
                view,
                previous,
                panorama.width,
                panorama.height,
                panorama.color,
                panorama.surface,
                panorama.range,
                self.color,
                self.normal,
                self.depth,
                self.id,
                self.motion,
            )

    def replace_color(self, background: NDArray[np.float32]) -> None:
        """Use another picture (H, W, 3), linear radiance, as what the camera sees."""
        self._device.write(self.color, self._layout.padded(np.moveaxis(background, -1, 0)))
