"""Interpolation of sparsely traced signals (IPRT, Algorithm 2)."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.gbuffer.guide import Guide
from iprt.settings.filter import InterpolateSettings


class Interpolate:
    """Fills the pixels that got no ray from traced ones of their surface, in place."""

    def __init__(
        self, device: ComputeDevice, guide: Guide, channels: int, settings: InterpolateSettings
    ) -> None:
        self.settings = settings
        self._device = device
        self._guide = guide
        self._kernel = device.kernel(
            "filter/interpolate.cl",
            "interpolate",
            guide.defines(SIGNAL_PLANES=channels),
        )

    def run(self, level: cla.Array, signal: cla.Array, offset: tuple[int, int]) -> None:
        """Complete `signal` in place.

        Parameters
        ----------
        level : 1 plane uint8
            `Mask.level`.
        signal : `channels` planes
            Holds values at traced pixels; afterwards at every pixel with a surface, else 0.
        offset : (int, int)
            What `Mask.run` was given.
        """
        with self._device.profile.section("interpolate"):
            self._kernel(
                self._guide.layout.size,
                self._guide.arguments(),
                level=level,
                signal=signal,
                normal_sharpness=self.settings.normal_sharpness,
                plane_sharpness=self.settings.plane_sharpness,
                offset_x=offset[0],
                offset_y=offset[1],
            )
