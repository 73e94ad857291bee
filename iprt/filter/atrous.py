"""Spatial filter: edge-avoiding à-trous wavelets in up to five levels (IPRT "Filtering")."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.program import Define
from iprt.filter.temporal import Kind, signal_defines, signal_planes
from iprt.gbuffer.guide import Guide
from iprt.settings.filter import AtrousSettings

ROW_GROUP = 16
"""Rows of a work group, at most: those beyond the picture are read too."""

Rect = tuple[int, int, int, int]
"""Pixels x0 <= x < x1, y0 <= y < y1, as (x0, y0, x1, y1)."""


class Atrous:
    """Filters one accumulated signal of one layer."""

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        kind: Kind,
        settings: AtrousSettings,
        *,
        name: str,
        guided: bool = True,
    ) -> None:
        """Without `guided`, luminance does not count: IPRT's joint bilateral filter."""
        self.settings = settings
        self.kind = kind
        self._device = device
        self._guide = guide
        self._real = kind in ("ratio", "delta")
        self._taps = 3 if self._real and guided else 5
        channels = signal_planes(kind)
        defines = guide.defines(
            **signal_defines(kind),
            SPECULAR=kind == "specular",
            EXTENT=kind == "delta",
            TAPS=self._taps,
            GUIDED=guided,
        )
        self._levels = [
            device.kernel("filter/atrous.cl", "filter_level", defines)
            for _ in range(settings.levels)
        ]
        self._smooth = device.kernel("filter/atrous.cl", "smooth_variance", defines)
        if kind == "specular":
            self._roughness = device.zeros(f"{name} widened roughness", guide.layout.shape(1))
        if kind == "delta":
            self._extent = Extent(device, guide, defines, name=name)
        if not guided:
            self._nothing = device.zeros(f"{name} no variance", guide.layout.shape(1))
        self._scratch = [
            (
                device.zeros(f"{name} filtered {i}", guide.layout.shape(channels)),
                device.zeros(f"{name} filtered variance {i}", guide.layout.shape(1)),
            )
            for i in range(2 if settings.levels else 0)
        ]

    def run(
        self,
        signal: cla.Array,
        variance: cla.Array | None = None,
        *,
        roughness: cla.Array | None = None,
        rect: Rect | None = None,
    ) -> cla.Array:
        """Return the filtered signal: buffers of this object, or the input if `levels` is 0.

        Parameters
        ----------
        signal : the signal's planes
        variance : 1 plane
            Variance of the mean of the scalar that the picture shows. None where not `guided`.
        roughness : 1 plane
            GGX alpha of the specular lobe, needed by that kind. Mirrors are copied.
        rect : Rect or None
            Where there are surfaces; outside it the result is undefined. None: everywhere.
        """
        settings, guide = self.settings, self._guide
        width, height = guide.layout.width, guide.layout.height
        if settings.levels == 0:
            return signal
        x0, y0, x1, y1 = rect = (0, 0, width, height) if rect is None else rect
        size = (x1 - x0, y1 - y0)
        if min(size) <= 0:
            return signal
        with self._device.profile.section(f"filter {'real' if self._real else self.kind}"):
            variance = self._nothing if variance is None else variance
            area = {**guide.arguments(), "x0": x0, "y0": y0, "x1": x1, "y1": y1}
            extra: dict[str, Any] = {}
            if self.kind == "delta":
                reach = self._taps // 2 * ((1 << settings.levels) - 1)
                extra = {"extent": self._extent.run(signal, variance, reach)}
            lobes = {}
            if self.kind == "specular":
                lobes = {"roughness": roughness, "widened": self._roughness}
                extra = {"roughness": self._roughness, "lobe_fraction": settings.lobe_fraction}
            smooth = self._scratch[-1][1]
            self._smooth(size, area, lobes, variance=variance, smooth=smooth)
            variance = smooth
            for level, kernel in enumerate(self._levels):
                signal_out, variance_out = self._scratch[level % 2]
                kernel(
                    size,
                    area,
                    extra,
                    signal=signal,
                    variance=variance,
                    signal_out=signal_out,
                    variance_out=variance_out,
                    step=1 << level,
                    normal_sharpness=settings.normal_sharpness,
                    plane_sharpness=settings.plane_sharpness,
                    variance_scale=settings.deviations**2,
                    floor_fraction=settings.floor,
                )
                signal, variance = signal_out, variance_out
        return signal


class Extent:
    """Which columns of each row the filter may change: the rest is 0 before and after."""

    def __init__(
        self, device: ComputeDevice, guide: Guide, defines: dict[str, Define], *, name: str
    ) -> None:
        self._guide = guide
        self._find = device.kernel("filter/atrous.cl", "find_extent", defines)
        self._grow = device.kernel("filter/atrous.cl", "grow_extent", defines)
        rows = guide.layout.height + ROW_GROUP

        def columns(label: str) -> cla.Array:
            return device.zeros(f"{name} {label}", (rows, 2), np.int32)

        self._found, self._used = columns("extent found"), columns("extent used")
        self._now, self._before = columns("extent"), columns("extent before")

    def run(self, signal: cla.Array, variance: cla.Array, reach: int) -> cla.Array:
        """(rows, 2) int32: first column and end of what `filter_level` has to write."""
        layout = self._guide.layout
        size, rows = layout.arguments(), (layout.height,)
        self._now, self._before = self._before, self._now
        self._find(rows, size, signal=signal, variance=variance, extent=self._found)
        self._grow(
            rows,
            size,
            found=self._found,
            previous=self._before,
            grown=self._now,
            extent=self._used,
            reach=reach,
        )
        return self._used
