"""Temporal accumulation with motion vectors (IPRT "Filtering"; SVGF section 4.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.filter.signals import Signal, signal_defines, signal_planes
from iprt.gbuffer.batch import batched
from iprt.gbuffer.guide import tile_arguments
from iprt.settings.filter import TemporalSettings

PLANE_TOLERANCE, MOVED_TOLERANCE = 0.02, 0.2
"""Distance from a pixel's plane / depth up to which its history is valid, and the same for virtual
surfaces while the scene changes, which may have moved."""

NORMAL_AGREEMENT = 0.9
"""Least cosine of the angle between present and past normal of a real surface."""

CLAMP_SIGMA, ANTILAG_SIGMA = 2.0, 3.0
"""Half width of the clamping box, and largest difference between fast and slow history that counts
as noise, in standard deviations."""

HISTORY_PLANES = 2
"""Planes of a history besides its signal's: `cl/lib/filter/history.h`."""

FAST_LENGTH = 6.0
"""Most samples of the fast history, as in ReLAX."""

FAST_FRAMES, FAST_LEAST = 6, 3
"""Frames after which the fast history restarts during continuing changes, so that it holds nothing
older, and frames that it must hold before the slow one is compared with it. Old light is gone after
eight. A fading mean of six samples still shows a quarter of it then."""

IPRT_FADING = 0.1
"""Share of each frame in IPRT's temporal mean."""

OUTLIER = 4.0
"""Most radiance of a sample, relative to its brightest neighbour, in a fading mean of reflected
light. A single path to a window would otherwise be a bright dot for many frames. (Suppression of
outliers by neighbours: NVIDIA's ReBLUR.)"""

SETTLE_FRAMES = 8
"""Frames after a change in which the slow history is still compared with the fast one."""


@dataclass(frozen=True)
class Accumulated:
    """Signal after temporal accumulation; the buffers are reused in the next-but-one picture.

    Attributes
    ----------
    signal : the signal's planes, float32, and the additional ones of `cl/lib/filter/history.h`
    certainty : 2 planes float32
        Variance of the mean of the displayed scalar: luminance of E_R - E_RV on real surfaces, of
        the signal on virtual ones. Effective number of samples of the mean; 0 without any.
    """

    signal: cla.Array
    certainty: cla.Array


class _History:
    """Histories of a batch of signals.

    Attributes
    ----------
    signals, certainties : lists of buffers
        Means, with the variances of single samples of g and g itself, and `Accumulated.certainty`,
        whose variance a fast history lacks.
    """

    def __init__(self, signals: Sequence[cla.Array], certainties: Sequence[cla.Array]) -> None:
        self.signals, self.certainties = signals, certainties
        self._named: dict[str, dict[str, cla.Array]] = {}

    def arguments(self, pattern: str) -> dict[str, cla.Array]:
        """Return the buffers by parameter names: `pattern` with "signal" and "certainty"."""
        named = self._named.get(pattern)
        if named is None:
            buffers = {"signal": self.signals, "certainty": self.certainties}
            named = batched(**{pattern.format(name): of for name, of in buffers.items()})
            self._named[pattern] = named
        return named


class Temporal:
    """Accumulator of a batch of signals over pictures.

    A slow history holds the mean. From the first picture after a change to the last but
    `SETTLE_FRAMES`, a fast history of `FAST_LENGTH` samples is kept beside it and corrects it. In
    other pictures every old sample is as valid as a new one.
    """

    def __init__(
        self,
        device: ComputeDevice,
        signals: Sequence[Signal],
        settings: TemporalSettings,
        *,
        rays: int = 1,
        published: bool = False,
    ) -> None:
        """Create histories and kernels.

        `rays` is the number per sample; pixels with a long history use fewer. `published`: IPRT's
        mean, a fixed share of each frame, with the history clamped.
        """
        self._published = published
        self._signals = signals
        self._device = device
        self._unsettled = 0
        # Frames in the fast history; whether the scene changed meanwhile, and whether it changed
        # before that.
        self._fast_frames, self._fast_stale, self._fast_again = 0, False, False
        guide = signals[0].guide
        channels = signal_planes(signals[0].kind)
        defines = signal_defines(signals) | guide.camera_define | {"PUBLISHED": published}

        def planes(label: str, channels: int) -> list[cla.Array]:
            shape = guide.layout.shape(channels)
            return [device.zeros(f"{signal.name} {label}", shape) for signal in signals]

        def histories(label: str) -> list[_History]:
            """Return the histories of this picture and of the previous one."""
            return [
                _History(
                    planes(f"{label} {i}", channels + HISTORY_PLANES),
                    planes(f"{label} certainty {i}", 2),
                )
                for i in range(2)
            ]

        self._now, self._before = histories("history")
        fixed = {
            **guide.layout.arguments(),
            **guide.camera_argument,
            **tile_arguments([signal.guide for signal in signals]),
            "normal_agreement": settings.normal_agreement,
            "rays": rays,
            "clamp_sigma": CLAMP_SIGMA,
            "planes": channels,
        }

        def kernel(entry: str, *, later: bool = False, **own: Any) -> Kernel:
            made = device.kernel("filter/temporal.cl", entry, defines, later=later)
            return made.fixed(fixed, own)

        self._estimate = kernel("estimate_variance")
        if published:
            self._accumulate = kernel("accumulate", fading=IPRT_FADING)
        else:
            self._accumulate = kernel("accumulate")
            self._fast, self._fast_before = histories("fast history")
            self._follow = kernel("follow", later=True, limit=FAST_LENGTH)
            self._fetch = kernel("fetch", later=True)
            of_real = signals[0].kind in ("ratio", "delta")
            self._correct = kernel(
                "correct_real" if of_real else "correct_reflected",
                later=True,
                antilag_sigma=ANTILAG_SIGMA,
            )

    @property
    def certainties(self) -> Sequence[cla.Array]:
        """`Accumulated.certainty` of each signal after the last picture."""
        return self._now.certainties

    @property
    def means(self) -> Sequence[cla.Array]:
        """Mean of each signal after the last picture, and two planes more (`filter/signal.h`)."""
        return self._now.signals

    @property
    def settled(self) -> bool:
        """True if the last change is so old that the slow history is used alone."""
        return not self._unsettled

    def reset(self) -> None:
        """Drop all samples, as after a cut."""
        for history in [self._now] if self._published else [self._now, self._fast]:
            for certainty in history.certainties:
                self._device.fill_zero(certainty)

    def run(
        self,
        samples: Sequence[cla.Array],
        motions: Sequence[cla.Array],
        levels: Sequence[cla.Array],
        *,
        fading: float,
        changed: bool,
    ) -> list[Accumulated]:
        """Add a picture's samples of each signal to its history.

        Parameters
        ----------
        samples : the signal's planes each
            Dense samples of this picture; not finite = no sample.
        motions : 2 planes each
            Previous position of each pixel's surface in pixels, -1e9 = nowhere.
        levels : 1 plane uint8 each
            `Mask.level`: a sample of level l counts as 1 / 4**l.
        fading : float
            Least share of the new samples: 0 keeps the mean of all (for a static scene).
        changed : bool
            Objects or the video moved.
        """
        self._now, self._before = self._before, self._now
        guides = [signal.guide for signal in self._signals]
        moved = changed and self._signals[0].kind in ("diffuse", "specular")
        fetched = {
            **batched(guide_previous=[guide.previous for guide in guides], motion=motions),
            **self._before.arguments("{}_before"),
            "plane_tolerance": MOVED_TOLERANCE if moved else PLANE_TOLERANCE,
        }
        added = {
            **batched(samples=samples, level=levels),
            **self._now.arguments("{}"),
            "fading": fading,
            **batched(outlier=[self._outlier(signal, fading) for signal in self._signals]),
        }
        if not self._published and self._unsettle(changed=changed):
            self._follow_changes(fetched, added)
            self._add_corrected(added)
        else:
            self._run(self._accumulate, fetched, added)
        self._run(self._estimate, added)
        return [
            Accumulated(signal, certainty)
            for signal, certainty in zip(self._now.signals, self._now.certainties, strict=True)
        ]

    def _unsettle(self, *, changed: bool) -> bool:
        """Return whether a change is recent: the slow history is compared with the fast one."""
        before = self._unsettled
        self._unsettled = SETTLE_FRAMES if changed else max(before - 1, 0)
        if not self._unsettled:
            if before:  # the next change restarts the fast history
                fast = (self._fast, self._fast_before)
                planes = (of for one in fast for of in (one.signals, one.certainties))
                self._device.discard(*chain.from_iterable(planes))
            return False
        again = bool(before) and self._fast_stale and self._fast_frames >= FAST_FRAMES
        if not before or again:
            self._fast_frames, self._fast_stale, self._fast_again = 0, False, again
        self._fast_stale |= changed and self._fast_frames > 0
        self._fast_frames += 1
        return True

    def _follow_changes(self, fetched: Mapping[str, Any], added: Mapping[str, Any]) -> None:
        """Reproject both histories to this picture, and add its samples to the fast ones."""
        self._fast, self._fast_before = self._fast_before, self._fast
        fast = self._fast_before.arguments("{}_before") | self._fast.arguments("{}")
        self._run(self._follow, fetched, added, fast, fresh=self._fast_frames == 1)
        self._run(self._fetch, fetched, added, batched(fast_signal=self._fast.signals))

    def _add_corrected(self, added: Mapping[str, Any]) -> None:
        """Correct the slow histories by the fast ones, and add the samples."""
        self._run(
            self._correct,
            added,
            self._fast.arguments("fast_{}"),
            trusted=not self._fast_again or self._fast_frames >= FAST_LEAST,
        )

    def _outlier(self, signal: Signal, fading: float) -> float:
        """Return the limit of a signal's samples; 0: none, so that the mean of all converges."""
        limited = fading > 0.0 and not self._published and not signal.signed
        return OUTLIER if limited else 0.0

    def _run(self, kernel: Kernel, *groups: Mapping[str, Any], **own: Any) -> None:
        guides = [signal.guide for signal in self._signals]
        kernel(
            guides[0].tiles.grid(len(guides)),
            batched(guide=[guide.current for guide in guides]),
            *groups,
            **own,
        )
