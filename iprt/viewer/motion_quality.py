"""Quality during motion: less light and less resolution, to hold a target frame rate.

Level 0 has the user's settings. The next levels are the faster entries of the ladder
(`iprt.settings.ladder`), and each one after them has fewer pixels. The time of a frame is a +
b·pixels, with a and b that depend on the scene. The controller assumes b·pixels alone. This
underestimates levels with fewer pixels, which another step down corrects, and overestimates levels
with more, so that a step up never overshoots. A change of level creates new buffers and histories.
There is therefore hysteresis between down and up, and each failed step up doubles the wait for the
next one.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Any

from iprt.measure.tradeoff import Tradeoff
from iprt.settings.ladder import entry_settings
from iprt.settings.model import Settings
from iprt.settings.overrides import changed, plain_values
from iprt.viewer.frame_rate import EventRate
from iprt.viewer.session import Shown

REST_S = 0.3
"""Seconds without input after which a picture is at rest."""
SHOWN_S = 1.0
"""Seconds after the last moving picture for which the frame rate is shown."""
TRACED = ("light_scale", "trace.rays", "trace.object_rays")
"""Settings that dominate the time of a frame."""
SCALES = (0.84, 0.71, 0.6, 0.5, 0.42, 0.35, 0.3, 0.25)
"""Side lengths of the picture relative to the window; each level has 1/sqrt(2) of the pixels of the
level before."""
SKIPPED = 2
"""Frames to ignore after a change: they create buffers, histories and caches."""
FEWEST, WINDOW = 4, 16
"""Number of newest frames that must be too slow for a step down, and of frames averaged for a step
up."""
OUTLIER = 3.0
"""Frame times are clamped to this multiple of the median, as some frames only waited."""
TOO_SLOW, ALL_TOO_SLOW = 1.1, 1.05
"""Thresholds for a step down: means of the newest frames and of the window, relative to the
target."""
ROOM_DOWN, ROOM_UP = 0.9, 0.8
"""Largest expected frame time of the new level, relative to the target, for a step down or up."""
UP_S, MOST_UP_S = 2.0, 64.0
"""Seconds on a level before a step up: initial and largest value."""


@dataclass(frozen=True)
class Preview:
    """A description of the reduced quality of a picture during motion.

    Attributes
    ----------
    short : str
        Short text, such as `Preview at 50% resolution`.
    details : str
        All differences.
    """

    short: str
    details: str


@dataclass(frozen=True, eq=False)
class Level:
    """Settings and a resolution that are faster than the user's.

    Attributes
    ----------
    settings : Settings
        A distinct object, even if equal to another level's.
    scale : float
        Sides of the picture relative to the window, at most 1.
    share : float
        Approximate time of a frame relative to level 0.
    preview : Preview or None
        Differences from the user's settings; None without any.
    """

    settings: Settings
    scale: float
    share: float
    preview: Preview | None


def levels_below(base: Settings, table: Tradeoff) -> tuple[Level, ...]:
    """Return the levels: the user's settings, then down the ladder, then down in size.

    No level exceeds `base` in any setting. None needs another real world
    (`Features.of_real_world`), so that the known E_R stays valid.
    """
    own = plain_values(base)
    found = [Level(base, 1.0, 1.0, None)]
    given_up: dict[str, Any] = {}
    whole = _ratio(own, table)
    for entry in sorted(table.entries, key=lambda entry: -entry.ratio[0]):
        fewer = {
            key: value
            for key, value in entry_settings(entry.name).items()
            if _less(key, value, own[key]) and not key.startswith("irradiance.")
        }
        share = _ratio(own | fewer, table) / whole
        if not fewer or share > found[-1].share or share == 1.0:
            continue
        if share == found[-1].share:  # the remaining reductions of a slower entry
            del found[-1]
        given_up = fewer
        found.append(_preview(base, given_up, 1.0, share))
    last = found[-1].share
    found += [_preview(base, given_up, scale, last * scale**2) for scale in SCALES]
    return tuple(found)


def _ratio(own: Mapping[str, Any], table: Tradeoff) -> float:
    """Estimate the time of a frame with these settings relative to the entry `BALANCED`.

    It is the time of the fastest entry that traces at least as much, or else of the slowest entry.
    """
    enough = [
        entry.ratio[0]
        for entry in table.entries
        if not any(_less(key, entry_settings(entry.name)[key], own[key]) for key in TRACED)
    ]
    return min(enough, default=max(entry.ratio[0] for entry in table.entries))


def _less(key: str, value: Any, than: Any) -> bool:
    """Return True if `value` makes a setting cheaper than the value `than`."""
    return bool(value > than if key == "light_scale" else value < than)


def _preview(base: Settings, given_up: Mapping[str, Any], scale: float, share: float) -> Level:
    """Build a level from changed settings and the relative size of the picture."""
    own = plain_values(base)
    size = [f"{100.0 * scale:.0f}% resolution"] if scale < 1.0 else []
    words = [
        f"{key} {value} instead of {own[key]}"
        for key, value in given_up.items()
        if value != own[key]
    ]
    last = "The picture gets its full quality as soon as nothing moves."
    preview = Preview(
        f"Preview at {(*size, 'reduced quality')[0]}", "\n".join([*size, *words, last])
    )
    return Level(changed(base, given_up), scale, share, preview)


class QualityController:
    """A controller of settings and resolution by measured frame times.

    Parameters
    ----------
    target_fps : float
        Frames per second to hold; above 0.
    base : Settings
        The user's settings. Make another `QualityController` if they change.
    table : Tradeoff
        Times of the ladder's entries.
    usual_s : float or None
        Seconds of a frame at the user's settings, if known; it selects the initial level.
    """

    def __init__(
        self,
        target_fps: float,
        base: Settings,
        table: Tradeoff,
        *,
        usual_s: float | None = None,
    ) -> None:
        self.base = base
        self.levels: Sequence[Level] = levels_below(base, table)
        self._target_s = 1.0 / target_fps
        self._up_s, self._now = UP_S, 0
        self._go(0)
        if usual_s is not None and usual_s > TOO_SLOW * self._target_s:
            self._go(self._fitting(usual_s, ROOM_DOWN))

    @property
    def level(self) -> Level:
        """The current level."""
        return self.levels[self._now]

    def observe(self, seconds: float, compiled: bool) -> None:
        """Record the time of a frame at the current level.

        Parameters
        ----------
        seconds : float
            Time of the frame.
        compiled : bool
            True if kernels were compiled or buffers created; the time is ignored then.
        """
        if compiled:
            return
        self._stood_s += seconds
        self._frames += 1
        if self._frames <= SKIPPED:
            return
        self._times.append(seconds)
        if len(self._times) < FEWEST:
            return
        newest = median([*self._times][-FEWEST:])
        usual = median(self._times)
        mean = fmean(min(taken, OUTLIER * usual) for taken in self._times)
        if newest > TOO_SLOW * self._target_s and mean > ALL_TOO_SLOW * self._target_s:
            if self._now < len(self.levels) - 1:
                failed = self._went_up and self._stood_s < MOST_UP_S
                self._up_s = min(2.0 * self._up_s, MOST_UP_S) if failed else UP_S
                self._go(max(self._fitting(newest, ROOM_DOWN), self._now + 1))
        elif self._stood_s >= self._up_s and len(self._times) == WINDOW:
            better = self._fitting(mean, ROOM_UP)
            if better < self._now:
                self._go(better)

    def _fitting(self, seconds: float, room: float) -> int:
        """Return the best level expected to hold the target, given the current frame time."""
        most = room * self._target_s / seconds * self.level.share
        fits = (number for number, level in enumerate(self.levels) if level.share <= most)
        return next(fits, len(self.levels) - 1)

    def _go(self, number: int) -> None:
        self._went_up = number < self._now
        self._now, self._frames, self._stood_s = number, 0, 0.0
        self._times: deque[float] = deque(maxlen=WINDOW)


class MotionQuality:
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
        self._rate = EventRate(clock)
        self._step = 0  # step of the last observed picture
        self._target_fps = target_fps
        self._controller: QualityController | None = None
        self._usual_s: float | None = None  # seconds of a frame at full quality

    @property
    def target_fps(self) -> float | None:
        """Frames per second to hold during motion; None for full quality."""
        return self._target_fps

    @target_fps.setter
    def target_fps(self, target_fps: float | None) -> None:
        if target_fps != self._target_fps:
            self._target_fps, self._controller = target_fps, None

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
        if self._controller is None or self._controller.base != base:
            self._controller = QualityController(
                self._target_fps, base, self._table, usual_s=self._usual_s
            )
        level = self._controller.level
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
        if (level is None or level.preview is None) and (seconds := _rendering_s(shown)):
            self._usual_s = seconds
        if (
            self._controller is not None
            and (level or self._controller.levels[0]) is self._controller.level
        ):
            self._controller.observe(shown.seconds, shown.compiled)

    def preview(self, shown: Shown) -> Preview | None:
        """Return the reductions of quality that hold the frame rate, or None."""
        level = self._level_of(shown)
        return None if level is None else level.preview

    def _level_of(self, shown: Shown) -> Level | None:
        """Return the level at which a picture was requested."""
        levels = () if self._controller is None else self._controller.levels
        return next((n for n in levels if n.settings is shown.request.settings), None)


def _rendering_s(shown: Shown) -> float:
    """Return the time of a picture in seconds, without compilation; 0 if it is not known.

    The passes of a first picture include the preparation of the world. The estimate is then too
    high, and quality rises again soon. Without it, the first drag would have full quality until
    several slow frames have been seen.
    """
    if not shown.compiled:
        return shown.seconds
    return 1e-3 * sum(entry.ms for entry in shown.passes)
