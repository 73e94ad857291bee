"""Requests during motion, with reduced quality if needed to hold a frame rate."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from iprt.measure.tradeoff import Tradeoff
from iprt.settings.model import Settings
from iprt.viewer.pace import Level, Pace, Preview
from iprt.viewer.rate import Rate
from iprt.viewer.session import Shown

REST_S = 0.3
"""Seconds without input after which a picture is at rest."""
SHOWN_S = 1.0
"""Seconds after the last moving picture for which the frame rate is shown."""


class Motion:
    """A detector of motion, and a controller of quality during motion; rest has full quality.

    Parameters
    ----------
    target_fps : float or None
        See the property.
    table : Tradeoff
        Measured times of the settings for motion.
    clock : callable
        Returns seconds.
    """

    def __init__(
        self,
        target_fps: float | None,
        table: Tradeoff,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._clock, self._table = clock, table
        self._stirred_s = self._moved_s = -math.inf
        self._rate = Rate(clock)
        self._step = 0  # step of the last observed picture
        self._target_fps = target_fps
        self._pace: Pace | None = None
        self._usual_s: float | None = None  # seconds of a frame at full quality

    @property
    def target_fps(self) -> float | None:
        """Frames per second to hold during motion; None for full quality."""
        return self._target_fps

    @target_fps.setter
    def target_fps(self, target_fps: float | None) -> None:
        if target_fps != self._target_fps:
            self._target_fps, self._pace = target_fps, None

    def stir(self) -> None:
        """Record input at the current time."""
        self._stirred_s = self._clock()

    @property
    def lively(self) -> bool:
        """True during motion and shortly after."""
        return self._clock() - self._moved_s < SHOWN_S

    @property
    def fps(self) -> float | None:
        """Pictures per second during motion; None at rest."""
        return self._rate.value if self.lively else None

    def level(self, base: Settings, *, playing: bool) -> Level | None:
        """Return the quality level to render at, or None for `base` at full resolution.

        Parameters
        ----------
        base : Settings
            The user's settings.
        playing : bool
            True while the video plays.
        """
        moving = playing or self._clock() - self._stirred_s < REST_S
        if not moving or self._target_fps is None:
            return None
        if self._pace is None or self._pace.base != base:
            self._pace = Pace(self._target_fps, base, self._table, usual_s=self._usual_s)
        level = self._pace.level
        return None if level.preview is None else level

    def observe(self, shown: Shown) -> None:
        """Record a new picture; in a quick sequence, some may be skipped."""
        fresh, self._step = shown.step - self._step, shown.step
        if 0 < shown.frames <= fresh:
            if not self.lively:
                self._rate.clear()
            self._moved_s = self._clock()
            self._rate.add()
        level = self._level_of(shown)
        if (level is None or level.preview is None) and not shown.compiled:
            self._usual_s = shown.seconds
        if self._pace is not None and (level or self._pace.levels[0]) is self._pace.level:
            self._pace.observe(shown.seconds, shown.compiled)

    def preview(self, shown: Shown) -> Preview | None:
        """Return the reductions of quality that hold the frame rate, or None."""
        level = self._level_of(shown)
        return None if level is None else level.preview

    def _level_of(self, shown: Shown) -> Level | None:
        """Return the level at which a picture was requested."""
        levels = () if self._pace is None else self._pace.levels
        return next((n for n in levels if n.settings is shown.request.settings), None)
