"""Temporal accumulation with motion vectors (IPRT "Filtering"; SVGF section 4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pyopencl.array as cla
from pydantic import BaseModel, ConfigDict, Field

from iprt.device.compute import ComputeDevice
from iprt.passes.guide import Guide, plane_defines

Kind = Literal["real", "diffuse", "specular"]
"""What a signal is: E_R rgb and E_RV rgb of real surfaces; irradiance or radiance of objects."""


def signal_planes(kind: Kind) -> int:
    """Number of planes of a signal."""
    return 6 if kind == "real" else 3


class TemporalSettings(BaseModel):
    """When the history of a pixel still describes it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    plane_tolerance: float = Field(
        default=0.02,
        gt=0.0,
        le=1.0,
        description="Distance from the pixel's plane / depth up to which a history is its own.",
    )
    moved_tolerance: float = Field(
        default=0.2,
        gt=0.0,
        le=1.0,
        description="The same for virtual surfaces while the scene changes: they may have moved.",
    )
    normal_agreement: float = Field(
        default=0.9,
        ge=-1.0,
        le=1.0,
        description="Least cosine of the angle between present and past normal.",
    )
    clamp_sigma: float = Field(
        default=2.0,
        gt=0.0,
        le=10.0,
        description="Half width of the clamping box in deviations; lower: less ghosting, more "
        "noise.",
    )
    clamped_length: float = Field(
        default=4.0,
        ge=1.0,
        le=64.0,
        description="Samples that a history is worth once clamped; lower: quicker, noisier.",
    )


@dataclass(frozen=True)
class Accumulated:
    """A signal after temporal accumulation; the buffers change with the next-but-one picture.

    Attributes
    ----------
    signal : the signal's planes, float32
    length : 1 plane float32
        Number of samples that the mean is worth; 0 where it holds none.
    variance : 1 plane float32
        Variance of the mean of the scalar that the picture shows: luminance of E_R - E_RV on real
        surfaces, of the signal on virtual ones.
    """

    signal: cla.Array
    length: cla.Array
    variance: cla.Array


class Temporal:
    """Accumulates one signal of one layer over pictures."""

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        kind: Kind,
        settings: TemporalSettings,
        *,
        name: str,
    ) -> None:
        self.settings = settings
        self.kind = kind
        self._device = device
        self._guide = guide
        defines = plane_defines(
            equirect=guide.equirect, SIGNAL_PLANES=signal_planes(kind), DIFFERENCE=kind == "real"
        )
        self._reproject = device.kernel("temporal.cl", "reproject", defines)
        self._clamp = device.kernel("temporal.cl", "clamp_history", defines)
        self._accumulate = device.kernel("temporal.cl", "accumulate", defines)
        self._estimate = device.kernel("temporal.cl", "estimate_variance", defines)

        def planes(label: str, channels: int = 1) -> cla.Array:
            return device.zeros(f"{name} {label}", guide.layout.shape(channels))

        self._scalar = planes("scalar")
        self._variance = planes("variance")
        # Signal, length, spread: of this picture and of the one before.
        self._now, self._before = (
            (
                planes(f"history {i}", signal_planes(kind)),
                planes(f"history length {i}"),
                planes(f"history spread {i}"),
            )
            for i in range(2)
        )

    def reset(self) -> None:
        """Forget everything, as after a cut."""
        self._device.fill_zero(self._now[1])

    def run(
        self,
        signal: cla.Array,
        motion: cla.Array,
        level: cla.Array,
        *,
        fading: float,
        changed: bool,
    ) -> Accumulated:
        """Add a picture's samples to the history.

        Parameters
        ----------
        signal : the signal's planes
            Dense samples of this picture; not finite = no sample. Its border is overwritten in
            equirect views.
        motion : 2 planes
            Previous position of each pixel's surface in pixels, -1e9 = nowhere.
        level : 1 plane uint8
            `Mask.level`: a sample of level l is worth 1 / 4**l.
        fading : float
            Least share of the new samples: 0 keeps the mean of all (for a still scene), 0.1 is
            IPRT's.
        changed : bool
            Objects or the video moved: clamp the history to this picture's neighbourhoods.
        """
        self._now, self._before = self._before, self._now
        guide, settings = self._guide, self.settings
        width, height = guide.layout.width, guide.layout.height
        loose = changed and self.kind != "real"
        with self._device.profile.section("temporal"):
            self._reproject(
                (width, height),
                guide.current,
                guide.previous,
                motion,
                *self._before,
                *self._now,
                settings.moved_tolerance if loose else settings.plane_tolerance,
                settings.normal_agreement,
                width,
                height,
            )
            if changed:
                guide.wrap(signal)
                history, length, _ = self._now
                self._clamp(
                    (width, height),
                    guide.current,
                    signal,
                    history,
                    length,
                    settings.clamp_sigma,
                    settings.clamped_length,
                    width,
                    height,
                )
            self._accumulate(
                (width, height),
                guide.current,
                signal,
                level,
                *self._now,
                self._scalar,
                float(fading),
                width,
                height,
            )
            guide.wrap(self._scalar)
            accumulated, length, spread = self._now
            self._estimate(
                (width, height),
                guide.current,
                self._scalar,
                spread,
                length,
                self._variance,
                width,
                height,
            )
        return Accumulated(accumulated, length, self._variance)
