"""Interpolation of sparsely traced signals (IPRT, Algorithm 2)."""

from __future__ import annotations

from collections.abc import Sequence

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.signals import Signal, signal_defines, signal_planes
from iprt.gbuffer.batch import batched
from iprt.gbuffer.guide import tile_arguments

NORMAL_SHARPNESS, PLANE_SHARPNESS = 32.0, 100.0
"""Edge-stopping weights: falloff per (1 - cosine) of the normals' angle, and per (distance from the
pixel's plane / depth). The à-trous filter has the latter too."""


class Interpolate:
    """Interpolation, in place, of pixels without a ray from traced ones of their surface."""

    def __init__(self, device: ComputeDevice, signals: Sequence[Signal]) -> None:
        self._guides = [signal.guide for signal in signals]
        self._kernel = device.kernel(
            "filter/neighbours.cl", "interpolate", signal_defines(signals)
        ).fixed(
            signals[0].guide.layout.arguments(),
            tile_arguments([signal.guide for signal in signals]),
            planes=signal_planes(signals[0].kind),
            normal_sharpness=NORMAL_SHARPNESS,
            plane_sharpness=PLANE_SHARPNESS,
        )

    def run(
        self,
        levels: Sequence[cla.Array],
        samples: Sequence[cla.Array],
        grid: cla.Array,
    ) -> None:
        """Complete the samples of each signal in place.

        Parameters
        ----------
        levels : 1 plane uint8 each
            `Mask.level`.
        samples : the signal's planes each
            Hold values at traced pixels; afterwards at every pixel with a surface, else 0.
        grid : (2,) int32
            As for `Masks.run`.
        """
        self._kernel(
            self._guides[0].tiles.grid(len(samples)),
            batched(
                guide=[guide.current for guide in self._guides],
                level=levels,
                signal=samples,
            ),
            origin=grid,
        )
