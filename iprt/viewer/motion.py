"""Requests while something moves: of less quality, if that is needed to hold a frame rate."""

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
"""Without input, after which a picture is at rest."""
SHOWN_S = 1.0
"""Seconds after the last picture that moved, for which the frame rate is shown."""


class Motion:
    """Tells motion from rest, and what is given up in motion. At rest nothing is.

    Parameters
    ----------
    target_fps : float or None
        See the property.
    table : Tradeoff
        Times of the settings that are taken in motion.
    clock : callable
        Seconds.
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
        self._step = 0  # of the last picture that was observed
        self._target_fps = target_fps
        self._pace: Pace | None = None
        self._usual_s: float | None = None  # of a frame of which nothing is given up

    @property
    def target_fps(self) -> float | None:
        """Frames per second to hold in motion; None: nothing is given up for it."""
        return self._target_fps

    @target_fps.setter
    def target_fps(self, target_fps: float | None) -> None:
        if target_fps != self._target_fps:
            self._target_fps, self._pace = target_fps, None

    def stir(self) -> None:
        """There was input, just now."""
        self._stirred_s = self._clock()

    @property
    def lively(self) -> bool:
        """Something moves, or did just now."""
        return self._clock() - self._moved_s < SHOWN_S

    @property
    def fps(self) -> float | None:
        """Pictures per second while something moves; None: nothing does."""
        return self._rate.value if self.lively else None

    def level(self, base: Settings, *, playing: bool) -> Level | None:
        """The level to render at in place of `base`; None: `base`, at full resolution.

        Parameters
        ----------
        playing : bool
            The video moves.
        """
        moving = playing or self._clock() - self._stirred_s < REST_S
        if not moving or self._target_fps is None:
            return None
        if self._pace is None or self._pace.base != base:
            self._pace = Pace(self._target_fps, base, self._table, usual_s=self._usual_s)
        level = self._pace.level
        return None if level.preview is None else level

    def observe(self, shown: Shown) -> None:
        """Take note of a new picture; of those that follow quickly, some may be left out."""
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
        """Quality given up to hold the frame rate; None: none."""
        level = self._level_of(shown)
        return None if level is None else level.preview

    def _level_of(self, shown: Shown) -> Level | None:
        """The level at which a picture was asked for."""
        levels = () if self._pace is None else self._pace.levels
        return next((n for n in levels if n.settings is shown.request.settings), None)
