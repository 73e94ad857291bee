"""Interpolation of sparsely traced signals (IPRT, Algorithm 2)."""

from __future__ import annotations

from collections.abc import Sequence

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.signals import Signal, signal_defines
from iprt.gbuffer.batch import batched
from iprt.settings.filter import InterpolateSettings


class Interpolate:
    """Fills the pixels that got no ray from traced ones of their surface, in place."""

    def __init__(
        self, device: ComputeDevice, signals: Sequence[Signal], settings: InterpolateSettings
    ) -> None:
        self.settings = settings
        self._device = device
        self._guides = [signal.guide for signal in signals]
        self._kernel = device.kernel(
            "filter/interpolate.cl", "interpolate", signal_defines(signals)
        )

    def run(
        self,
        levels: Sequence[cla.Array],
        samples: Sequence[cla.Array],
        offset: tuple[int, int],
    ) -> None:
        """Complete the samples of each signal in place.

        Parameters
        ----------
        levels : 1 plane uint8 each
            `Mask.level`.
        samples : the signal's planes each
            Hold values at traced pixels; afterwards at every pixel with a surface, else 0.
        offset : (int, int)
            What `Masks.run` was given.
        """
        layout = self._guides[0].layout
        with self._device.profile.section("interpolate"):
            self._kernel(
                (*layout.size, len(samples)),
                layout.arguments(),
                batched(
                    guide=[guide.current for guide in self._guides],
                    level=levels,
                    signal=samples,
                ),
                normal_sharpness=self.settings.normal_sharpness,
                plane_sharpness=self.settings.plane_sharpness,
                offset_x=offset[0],
                offset_y=offset[1],
            )
