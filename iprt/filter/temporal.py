"""Temporal accumulation with motion vectors (IPRT "Filtering"; SVGF section 4.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice, Kernel
from iprt.device.program import Define
from iprt.gbuffer.guide import Guide
from iprt.settings.filter import TemporalSettings

Kind = Literal["ratio", "delta", "diffuse", "specular"]
"""What a signal is. For real surfaces, by estimator: E_R rgb and E_RV rgb; or blocked / E_R rgb and
bounce / E_R rgb. For objects: irradiance or radiance."""

Planes = tuple[cla.Array, cla.Array, cla.Array]
"""A history: signal, length in samples, and spread, the variance of single samples of g."""

FAST_LENGTH = 6.0
"""Samples that the fast history is worth at most, as in ReLAX."""

FAST_FRAMES, FAST_LEAST = 6, 3
"""Frames after which the fast history starts anew if changes go on, so that it holds nothing older,
and frames that it then has to hold before the slow one is compared with it: what has left is gone
after eight. A fading mean of six samples still shows a quarter of it then."""

IPRT_FADING = 0.1
"""Share of each frame in IPRT's temporal mean."""

SETTLE_FRAMES = 8
"""Frames after a change in which the slow history is still compared with the fast one."""


def signal_planes(kind: Kind) -> int:
    """Number of planes of a signal."""
    return 6 if kind in ("ratio", "delta") else 3


def signal_defines(kind: Kind) -> dict[str, Define]:
    """Build flags of kernels that work on signals of a kind."""
    return {
        "SIGNAL_PLANES": signal_planes(kind),
        "DIFFERENCE": kind in ("ratio", "delta"),
        "COMMON": kind == "ratio",
    }


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
    """Accumulates one signal of one layer over pictures.

    A slow history holds the mean. From the first picture after a change to the last but
    `SETTLE_FRAMES`, a fast history of `FAST_LENGTH` samples is kept beside it, and the slow one
    corrected by it. In other pictures every old sample is as true as a new one.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        kind: Kind,
        settings: TemporalSettings,
        *,
        name: str,
        rays: int = 1,
        published: bool = False,
    ) -> None:
        """`rays` are those of a sample, of which pixels with a long history send fewer.

        `published`: the mean is IPRT's, a fixed share of each frame, the rest clamped.
        """
        self.settings = settings
        self._published = published
        self._rays = rays
        self.kind = kind
        self._device = device
        self._guide = guide
        self._unsettled = 0
        # Frames that the fast history holds; whether the scene changed in between, and whether it
        # did so before.
        self._fast_frames, self._fast_stale, self._fast_again = 0, False, False
        defines = guide.defines(PUBLISHED=published, **signal_defines(kind), **guide.camera_define)

        def kernel(entry: str) -> Kernel:
            return device.kernel("filter/temporal.cl", entry, defines)

        self._accumulate = kernel("accumulate")
        self._estimate = kernel("estimate_variance")

        def planes(label: str, channels: int = 1) -> cla.Array:
            return device.zeros(f"{name} {label}", guide.layout.shape(channels))

        def histories(label: str) -> list[Planes]:
            """Signal, length, spread: of this picture and of the one before."""
            return [
                (
                    planes(f"{label} {i}", signal_planes(kind)),
                    planes(f"{label} length {i}"),
                    planes(f"{label} spread {i}"),
                )
                for i in range(2)
            ]

        self._scalar = planes("scalar")
        self._variance = planes("variance")
        self._now, self._before = histories("history")
        if not published:
            self._follow, self._correct = kernel("follow"), kernel("correct")
            self._past_scalar = planes("past scalar")
            self._fast, self._fast_before = histories("fast history")

    @property
    def length(self) -> cla.Array:
        """1 plane: how many samples each pixel's mean was worth after the last picture."""
        return self._now[1]

    def reset(self) -> None:
        """Forget everything, as after a cut."""
        self._device.fill_zero(self._now[1])
        if not self._published:
            self._device.fill_zero(self._fast[1])

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
            Dense samples of this picture; not finite = no sample.
        motion : 2 planes
            Previous position of each pixel's surface in pixels, -1e9 = nowhere.
        level : 1 plane uint8
            `Mask.level`: a sample of level l is worth 1 / 4**l.
        fading : float
            Least share of the new samples: 0 keeps the mean of all (for a still scene).
        changed : bool
            Objects or the video moved.
        """
        self._now, self._before = self._before, self._now
        settings = self.settings
        moved = changed and self.kind in ("diffuse", "specular")
        fetched = {
            **self._guide.motion_arguments(),
            "motion": motion,
            **_named(self._before, "{}_before"),
            "plane_tolerance": settings.moved_tolerance if moved else settings.plane_tolerance,
            "normal_agreement": settings.normal_agreement,
        }
        added = {
            "samples": signal,
            "level": level,
            **_named(self._now, "{}"),
            "scalar": self._scalar,
            "fading": IPRT_FADING if self._published else fading,
            "rays": self._rays,
        }
        with self._device.profile.section("temporal"):
            if self._published:
                self._run(self._accumulate, fetched, added, clamp_sigma=settings.clamp_sigma)
            elif self._unsettle(changed=changed):
                self._follow_changes(fetched, signal, level)
                self._add_corrected(added)
            else:
                self._run(self._accumulate, fetched, added)
            accumulated, length, spread = self._now
            self._run(
                self._estimate,
                scalar=self._scalar,
                spread=spread,
                length=length,
                variance=self._variance,
            )
        return Accumulated(accumulated, length, self._variance)

    def _unsettle(self, *, changed: bool) -> bool:
        """Whether changes are so recent that the slow history is compared with the fast one."""
        before = self._unsettled
        self._unsettled = SETTLE_FRAMES if changed else max(before - 1, 0)
        if not self._unsettled:
            return False
        again = bool(before) and self._fast_stale and self._fast_frames >= FAST_FRAMES
        if not before or again:
            self._fast_frames, self._fast_stale, self._fast_again = 0, False, again
        self._fast_stale |= changed and self._fast_frames > 0
        self._fast_frames += 1
        return True

    def _follow_changes(
        self, fetched: Mapping[str, Any], signal: cla.Array, level: cla.Array
    ) -> None:
        """Bring both histories to this picture, and add its samples to the fast one."""
        self._fast, self._fast_before = self._fast_before, self._fast
        self._run(
            self._follow,
            fetched,
            _named(self._fast_before, "fast_{}_before"),
            _named(self._now, "{}"),
            _named(self._fast, "fast_{}"),
            samples=signal,
            level=level,
            scalar=self._past_scalar,
            limit=FAST_LENGTH,
            fresh=self._fast_frames == 1,
        )

    def _add_corrected(self, added: Mapping[str, Any]) -> None:
        """Add the samples to the slow history, once it agrees with the fast one."""
        fast, fast_length, _ = self._fast
        self._run(
            self._correct,
            added,
            fast_signal=fast,
            fast_length=fast_length,
            past_scalar=self._past_scalar,
            antilag_sigma=self.settings.antilag_sigma,
            clamp_sigma=self.settings.clamp_sigma,
            trusted=not self._fast_again or self._fast_frames >= FAST_LEAST,
        )

    def _run(self, kernel: Kernel, *groups: Mapping[str, Any], **own: Any) -> None:
        kernel(self._guide.layout.size, self._guide.arguments(), *groups, **own)


def _named(history: Planes, pattern: str) -> dict[str, cla.Array]:
    """The planes of a history by the names of a kernel's parameters."""
    signal, length, spread = history
    return {
        pattern.format("signal"): signal,
        pattern.format("length"): length,
        pattern.format("spread"): spread,
    }
