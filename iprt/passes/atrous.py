"""Spatial filter: edge-avoiding à-trous wavelets in up to five levels (IPRT "Filtering")."""

from __future__ import annotations

import pyopencl.array as cla
from pydantic import BaseModel, ConfigDict, Field

from iprt.device.compute import ComputeDevice
from iprt.passes.guide import Guide, plane_defines
from iprt.passes.temporal import Accumulated, Kind, signal_planes

Rect = tuple[int, int, int, int]
"""Pixels x0 <= x < x1, y0 <= y < y1, as (x0, y0, x1, y1)."""


class AtrousSettings(BaseModel):
    """How far the filter reaches, and what stops it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    levels: int = Field(
        default=5,
        ge=0,
        le=5,
        description="Levels: taps reach 2 (2^levels - 1) pixels, 62 at 5; 0 leaves the noise.",
    )
    normal_sharpness: float = Field(
        default=24.0,
        ge=0.0,
        le=1e5,
        description="Falloff per (1 - cosine) of the normals' angle; higher keeps creases.",
    )
    plane_sharpness: float = Field(
        default=100.0,
        ge=0.0,
        le=1e5,
        description="Falloff per (distance from the pixel's plane / depth); higher keeps steps.",
    )
    deviations: float = Field(
        default=6.0,
        gt=0.0,
        le=100.0,
        description="Differences of so many standard deviations count as noise; lower keeps more "
        "detail and more noise.",
    )
    floor: float = Field(
        default=0.002,
        ge=0.0,
        le=1.0,
        description="Differences up to this fraction of a pixel's luminance count as noise always.",
    )
    lobe_fraction: float = Field(
        default=0.5,
        gt=0.0,
        le=4.0,
        description="Specular: fraction of the reflection lobe's half width that taps may span.",
    )


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
    ) -> None:
        self.settings = settings
        self.kind = kind
        self._device = device
        self._guide = guide
        channels = signal_planes(kind)
        defines = plane_defines(
            SIGNAL_PLANES=channels, DIFFERENCE=kind == "real", SPECULAR=kind == "specular"
        )
        self._filter = device.kernel("atrous.cl", "filter_level", defines)
        self._smooth = device.kernel("atrous.cl", "smooth_variance", defines)
        self._scratch = [
            (
                device.zeros(f"{name} filtered {i}", guide.layout.shape(channels)),
                device.zeros(f"{name} filtered variance {i}", guide.layout.shape(1)),
            )
            for i in range(2 if settings.levels else 0)
        ]

    def run(
        self,
        accumulated: Accumulated,
        *,
        roughness: cla.Array | None = None,
        rect: Rect | None = None,
    ) -> cla.Array:
        """Return the filtered signal: buffers of this object, or the input if `levels` is 0.

        Parameters
        ----------
        accumulated : Accumulated
            Not changed, but for borders in equirect views.
        roughness : 1 plane
            GGX alpha of the specular lobe, needed by that kind; below 1e-4 the pixel is copied.
        rect : Rect or None
            Where there are surfaces; outside it the result is undefined. None: everywhere.
        """
        settings, guide = self.settings, self._guide
        width, height = guide.layout.width, guide.layout.height
        if settings.levels == 0:
            return accumulated.signal
        x0, y0, x1, y1 = rect = (0, 0, width, height) if rect is None else rect
        size = (x1 - x0, y1 - y0)
        signal, (_, variance) = accumulated.signal, self._scratch[-1]
        if min(size) <= 0:
            return signal
        lobe = (roughness, settings.lobe_fraction) if self.kind == "specular" else ()
        with self._device.profile.section(f"filter {self.kind}"):
            guide.wrap(accumulated.variance)
            self._smooth(size, guide.current, accumulated.variance, variance, *rect, width, height)
            for level in range(settings.levels):
                guide.wrap(signal)
                guide.wrap(variance)
                signal_out, variance_out = self._scratch[level % 2]
                self._filter(
                    size,
                    guide.current,
                    signal,
                    variance,
                    signal_out,
                    variance_out,
                    *lobe,
                    1 << level,
                    settings.normal_sharpness,
                    settings.plane_sharpness,
                    settings.deviations**2,
                    settings.floor,
                    *rect,
                    width,
                    height,
                )
                signal, variance = signal_out, variance_out
        return signal
