"""From sparse samples of a signal to a picture of it, without noise."""

from __future__ import annotations

import pyopencl.array as cla

from iprt.device.compute import ComputeDevice
from iprt.filter.atrous import Atrous
from iprt.filter.history_fix import HistoryFix
from iprt.filter.interpolate import Interpolate
from iprt.filter.mask import Mask, grid_offset
from iprt.filter.temporal import Accumulated, Kind, Temporal, signal_planes
from iprt.gbuffer.context import FrameContext
from iprt.gbuffer.guide import Guide
from iprt.settings.model import Settings


class SignalFilter:
    """Sparse samples of one signal become a clean picture: interpolate, accumulate, filter.

    Attributes
    ----------
    accumulated : Accumulated or None
        The signal before the spatial filter, after the first frame; of the published filter, after
        it.
    """

    def __init__(
        self,
        device: ComputeDevice,
        guide: Guide,
        kind: Kind,
        settings: Settings,
        *,
        name: str,
        published: bool,
    ) -> None:
        """`published`: filter in space first, then accumulate a fixed share of each frame."""
        self._published = published
        self._interpolate = Interpolate(device, guide, signal_planes(kind), settings.interpolate)
        rays = settings.trace.object_rays if kind in ("diffuse", "specular") else 1
        self._temporal = Temporal(
            device, guide, kind, settings.temporal, name=name, rays=rays, published=published
        )
        self._atrous = Atrous(device, guide, kind, settings.atrous, name=name, guided=not published)
        self.accumulated: Accumulated | None = None
        self._fix: HistoryFix | None = None
        enough = settings.temporal.enough
        # Reflections differ too much between far pixels.
        if enough > 0.0 and settings.atrous.levels and kind != "specular" and not published:
            self._fix = HistoryFix(device, guide, kind, settings.atrous, enough, name=name)

    @property
    def history(self) -> cla.Array:
        """`Temporal.length` of the signal."""
        return self._temporal.length

    def start(self, context: FrameContext) -> None:
        """Begin a frame, before its rays are sent: the history says how many; a cut ends it."""
        if context.cut:
            self._temporal.reset()

    def run(
        self,
        signal: cla.Array,
        mask: Mask,
        motion: cla.Array,
        context: FrameContext,
        *,
        roughness: cla.Array | None = None,
        rect: tuple[int, int, int, int] | None = None,
    ) -> cla.Array:
        """The filtered planes of `signal`, which holds values where `mask` had rays traced."""
        self._interpolate.run(mask.level, signal, grid_offset(context.index))
        if self._published:
            signal = self._atrous.run(signal, roughness=roughness, rect=rect)
        accumulated = self._temporal.run(
            signal, motion, mask.level, fading=context.fading, changed=context.changed
        )
        if self._fix is not None:
            accumulated = self._fix.run(accumulated, mask.level)
        self.accumulated = accumulated
        if self._published:
            return accumulated.signal
        return self._atrous.run(
            accumulated.signal, accumulated.variance, roughness=roughness, rect=rect
        )
