"""From sparse samples of signals to noise-free pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.atrous import Atrous
from iprt.filter.history_fix import HistoryFix
from iprt.filter.interpolate import Interpolate
from iprt.filter.mask import Mask
from iprt.filter.signals import Signal
from iprt.filter.temporal import Accumulated, Temporal
from iprt.gbuffer.context import FrameContext
from iprt.passes import Clock, Pass
from iprt.settings.model import Settings


@dataclass(frozen=True)
class Samples:
    """Samples of a signal in a frame.

    Attributes
    ----------
    planes : the signal's planes
        Hold values where `mask` had rays traced.
    mask : Mask
    motion : 2 planes
        Previous position of each pixel's surface, in pixels; -1e9 = nowhere.
    roughness : 1 plane or None
        GGX alpha, of specular signals.
    """

    planes: cla.Array
    mask: Mask
    motion: cla.Array
    roughness: cla.Array | None = None


class SignalFilter:
    """Filter chain for sparse samples of signals: interpolate, accumulate, filter.

    Attributes
    ----------
    variances : list of 1 plane
        As in `Atrous`.
    accumulated : list of Accumulated
        The signals before the spatial filter, after the first frame; with `published`, after it.
    filtered : sequence of arrays
        Planes of each signal, after the last pass that ran.
    """

    def __init__(
        self,
        device: ComputeDevice,
        signals: Sequence[Signal],
        settings: Settings,
        *,
        published: bool,
    ) -> None:
        """Create the stages for a batch of signals.

        `published`: filter in space first, then accumulate a fixed share of each frame.
        """
        self._published = published
        self._interpolate = Interpolate(device, signals)
        self._reflected = signals[0].kind in ("diffuse", "specular")
        rays = settings.trace.object_rays if self._reflected else 1
        self._temporal = Temporal(
            device, signals, settings.temporal, rays=rays, published=published
        )
        self._atrous = Atrous(device, signals, settings.atrous, guided=not published)
        self.variances = self._atrous.variances
        self.accumulated: list[Accumulated] = []
        self.filtered: Sequence[cla.Array] = []
        self._variances: Sequence[cla.Array] = []
        self._frame: Sequence[Samples] = []
        enough = settings.temporal.enough
        fixed = enough > 0.0 and settings.atrous.levels > 0 and not published
        self._fixes = [
            # Reflections differ too much between distant pixels.
            HistoryFix(device, signal, settings.atrous, enough, self._atrous.free(i))
            if fixed and signal.kind != "specular"
            else None
            for i, signal in enumerate(signals)
        ]

    @property
    def histories(self) -> Sequence[cla.Array]:
        """`Temporal.certainties` of the signals."""
        return self._temporal.certainties

    @property
    def means(self) -> Sequence[cla.Array]:
        """`Temporal.means` of the signals."""
        return self._temporal.means

    def known(self, context: FrameContext) -> Sequence[cla.Array] | None:
        """Return `histories`, if pixels with a long one may get fewer rays in this frame.

        A fading mean holds a fixed number of samples, whatever their age. All rays are needed for
        the mean of all frames, while histories follow a change, and by the published method.
        """
        settled = self._temporal.settled and not context.changed
        return self.histories if settled and context.fading > 0.0 and not self._published else None

    def start(self, context: FrameContext) -> None:
        """Begin a frame, before its rays are traced; a cut ends the histories."""
        if context.cut:
            self._temporal.reset()

    def passes(
        self,
        of: str,
        frame: Callable[[], Sequence[Samples]],
        radiance: Callable[[], float],
    ) -> list[Pass[FrameContext]]:
        """Return the passes that fill `filtered` from the samples of a frame.

        Parameters
        ----------
        of : str
            Name of the pixels.
        frame : callable
            Returns the frame's samples of each signal, once they are traced.
        radiance : callable
            Returns the mean radiance of the panorama.
        """
        samples, signals, smooth = f"{of} samples", f"{of} signals", f"{of} light"

        def add(name: str, run: Callable[[FrameContext], None], reads: str, writes: str) -> None:
            passes.append(Pass(name, Clock.FRAME, run, (reads, f"{of} guide"), (writes,)))

        def blur(_: FrameContext) -> None:
            self._blur(radiance())

        passes: list[Pass[FrameContext]] = []
        add("interpolate", lambda context: self._begin(frame(), context), samples, samples)
        if self._published:
            add(self._atrous.name, blur, samples, signals)
            add("temporal", self._accumulate, signals, smooth)
            return passes
        add("temporal", self._accumulate, samples, signals)
        if any(self._fixes):
            add("history fix", self._fix, signals, signals)
        add(self._atrous.name, blur, signals, smooth)
        return passes

    def run(
        self, frame: Sequence[Samples], context: FrameContext, *, radiance: float
    ) -> Sequence[cla.Array]:
        """Return the filtered planes of each signal; `radiance` is the mean of the panorama."""
        for one in self.passes("", lambda: frame, lambda: radiance):
            one.run(context)
        return self.filtered

    def _begin(self, frame: Sequence[Samples], context: FrameContext) -> None:
        self._frame = frame
        self.filtered = [samples.planes for samples in frame]
        self._interpolate.run(self._levels, self.filtered, context.grid)

    @property
    def _levels(self) -> list[cla.Array]:
        return [samples.mask.level for samples in self._frame]

    def _accumulate(self, context: FrameContext) -> None:
        self.accumulated = self._temporal.run(
            self.filtered,
            [samples.motion for samples in self._frame],
            self._levels,
            fading=context.reflected_fading if self._reflected else context.fading,
            changed=context.changed,
        )
        self.filtered = [signal.signal for signal in self.accumulated]
        # The first plane of a certainty is the variance.
        self._variances = [signal.certainty for signal in self.accumulated]

    def _fix(self, _: FrameContext) -> None:
        fixed = [
            (signal.signal, signal.certainty) if fix is None else fix.run(signal, level)
            for signal, fix, level in zip(self.accumulated, self._fixes, self._levels, strict=True)
        ]
        self.filtered = [signal for signal, _ in fixed]
        self._variances = [variance for _, variance in fixed]

    def _blur(self, radiance: float) -> None:
        variances = None if self._published else self._variances
        roughness = [samples.roughness for samples in self._frame]
        self.filtered = self._atrous.run(
            self.filtered, variances, roughness=roughness, radiance=radiance
        )
