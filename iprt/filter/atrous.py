"""Spatial filter: edge-avoiding à-trous wavelets in up to five levels (IPRT "Filtering")."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.program import Define
from iprt.filter.interpolate import PLANE_SHARPNESS
from iprt.filter.signals import Signal, half_unit, signal_defines, signal_planes
from iprt.gbuffer.batch import batched
from iprt.gbuffer.guide import tile_arguments
from iprt.settings.filter import AtrousSettings


class Atrous:
    """Spatial filter of a batch of accumulated signals.

    Attributes
    ----------
    variances : list of 1 plane
        Variance of each filtered signal's displayed scalar, as `STORED_IN` of
        `cl/lib/gbuffer/stored.h`; none where `levels` is 0 or without `guided`.
    """

    def __init__(
        self,
        device: ComputeDevice,
        signals: Sequence[Signal],
        settings: AtrousSettings,
        *,
        guided: bool = True,
    ) -> None:
        """Create the kernels; without `guided`, of IPRT's joint bilateral filter."""
        self.settings = settings
        self._signals = signals
        self._device = device
        first = signals[0]
        self._layout = layout = first.guide.layout
        self._tiles = tile_arguments([signal.guide for signal in signals])
        self._specular = sum(signal.kind == "specular" for signal in signals)
        self._real = first.kind in ("ratio", "delta")
        assert not self._real or len(signals) == 1
        defines = signal_defines(signals) | {"GUIDED": guided}
        # Rounding to half precision would lose the difference of E_R and E_RV.
        self._half = device.half_planes and first.kind != "ratio"
        defines["HALF_PLANES"] = self._half
        self._stored = np.float16 if self._half else np.float32
        self.variances: list[cla.Array] = []
        if not settings.levels:
            return
        if not guided:
            self._nothing = self._planes("no variance")
        channels = signal_planes(first.kind)
        self._scratch = [
            (
                self._planes(f"filtered {i}", channels, self._stored),
                self._planes(f"filtered variance {i}", 1, self._stored),
            )
            for i in range(2)
        ]
        self._filtered, variances = self._scratch[(settings.levels - 1) % 2]
        if guided:
            self.variances = variances
        if self._half:
            self._filtered = self._planes("filtered", channels)
        self._own = self._of_kind()
        self._smooth = device.kernel("filter/atrous.cl", f"smooth_{self._kind}", defines).fixed(
            layout.arguments(), self._tiles, self._own, batched(smooth=self._scratch[-1][1])
        )
        self._levels = [self._level(level, defines) for level in range(settings.levels)]

    def free(self, signal: int) -> cla.Array | None:
        """Return float32 planes that the first level may read but does not write, if there are."""
        return None if self._half else self._scratch[1][0][signal]

    @property
    def name(self) -> str:
        """Name of its pass."""
        return f"filter {self._kind}"

    @property
    def _kind(self) -> str:
        """Suffix of the kernels for this kind of signal."""
        return "real" if self._real else "reflected"

    def _planes(
        self,
        label: str,
        channels: int = 1,
        dtype: type[np.floating[Any]] = np.float32,
        *,
        signals: int | None = None,
    ) -> list[cla.Array]:
        """Return new planes of each signal, or of the first `signals`."""
        shape = self._layout.shape(channels)
        return [
            self._device.zeros(f"{signal.name} {label}", shape, dtype)
            for signal in self._signals[:signals]
        ]

    def _of_kind(self) -> dict[str, Any]:
        """Return the arguments that only kernels of this kind of signal have."""
        if self._real:
            return batched(turned=self._planes("least turn", 1, self._stored))
        widened = self._planes("widened roughness", 1, self._stored, signals=self._specular)
        # Signals without a lobe are bound to another plane, which is not used.
        lacking = len(self._signals) - self._specular
        widened += (widened or self._scratch[0][1])[:1] * lacking
        return {
            **batched(widened=widened),
            "specular": self._specular,
            "lobe_fraction": self.settings.lobe_fraction,
        }

    def _level(self, level: int, defines: Mapping[str, Define]) -> Kernel:
        """Return a level's kernel: the first reads signals, others the previous level's."""
        settings = self.settings
        signal, variance = self._scratch[(level - 1) % 2]
        signal_out, variance_out = self._scratch[level % 2]
        last = level == settings.levels - 1
        if last:
            signal_out = self._filtered
        if self._half:
            defines = {**defines, "FIRST": level == 0, "LAST": last}
        kernel = self._device.kernel("filter/atrous.cl", f"filter_{self._kind}", defines).fixed(
            self._layout.arguments(),
            self._tiles,
            self._own,
            batched(variance=variance, signal_out=signal_out, variance_out=variance_out),
            step=1 << level,
            normal_sharpness=settings.normal_sharpness,
            plane_sharpness=PLANE_SHARPNESS,
            variance_scale=settings.deviations**2,
        )
        return kernel.fixed(batched(signal=signal)) if level else kernel

    def run(
        self,
        signals: Sequence[cla.Array],
        variances: Sequence[cla.Array] | None = None,
        *,
        roughness: Sequence[cla.Array | None] = (),
        radiance: float,
    ) -> Sequence[cla.Array]:
        """Return the filtered signals: buffers of this object, or the inputs if `levels` is 0.

        Parameters
        ----------
        signals : the signal's planes each
        variances : 1 plane each
            Variance of the mean of the displayed scalar; of specular signals
            `Accumulated.certainty`, 2 planes. None where not `guided`.
        roughness : 1 plane or None each
            GGX alpha of the specular lobe, needed by that kind. Mirrors are copied where they are
            flat or have few samples.
        radiance : float
            Mean of the panorama, the scale of signals that are radiance.
        """
        if self.settings.levels == 0:
            return signals
        size = self._signals[0].guide.tiles.lanes(len(signals))
        variances = self._nothing if variances is None else variances
        guide = batched(guide=[signal.guide.current for signal in self._signals])
        lobes = {} if self._real else batched(roughness=roughness or [None] * len(signals))
        unit = {"unit": half_unit(self._signals[0].kind, radiance)}
        self._smooth(size, guide, lobes, unit, batched(variance=variances))
        for kernel in self._levels:
            kernel(size, guide, unit, batched(signal=signals))
        return self._filtered
