"""Reconstruction of pixels with a short history from distant neighbours (after NVIDIA's ReLAX)."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.interpolate import PLANE_SHARPNESS
from iprt.filter.signals import Signal, signal_defines, signal_planes
from iprt.filter.temporal import Accumulated
from iprt.gbuffer.guide import tile_arguments
from iprt.settings.filter import AtrousSettings

STRIDE, OF_HEIGHT = 14.0, 1.0 / 36.0
"""Most pixels between taps without any history, and the same as a fraction of the rows."""


class HistoryFix:
    """Blend of accumulated pixels that have few samples with their surroundings."""

    def __init__(
        self,
        device: ComputeDevice,
        signal: Signal,
        settings: AtrousSettings,
        enough: float,
        out: cla.Array | None = None,
    ) -> None:
        """Create the kernel, which leaves histories of at least `enough` samples unchanged.

        `out`: planes of the signal to fill; None: new ones.
        """
        self._guide = guide = signal.guide
        layout = guide.layout
        planes = signal_planes(signal.kind)
        shape = layout.shape(planes)
        self._signal = device.zeros(f"{signal.name} fixed", shape) if out is None else out
        self._variance = device.zeros(f"{signal.name} fixed variance", layout.shape(1))
        defines = signal_defines([signal])
        self._fix = device.kernel("filter/neighbours.cl", "fix_history", defines).fixed(
            layout.arguments(),
            tile_arguments([guide]),
            planes=planes,
            signal_out=self._signal,
            variance_out=self._variance,
            stride=min(STRIDE, OF_HEIGHT * layout.height),
            enough=enough,
            normal_sharpness=settings.normal_sharpness,
            plane_sharpness=PLANE_SHARPNESS,
        )

    def run(self, accumulated: Accumulated, level: cla.Array) -> tuple[cla.Array, cla.Array]:
        """Return the signal and its variance, 1 plane, in buffers of this object.

        `level` is `Mask.level`.
        """
        self._fix(
            self._guide.tiles.grid(),
            guide=self._guide.current,
            signal=accumulated.signal,
            certainty=accumulated.certainty,
            level=level,
        )
        return self._signal, self._variance
