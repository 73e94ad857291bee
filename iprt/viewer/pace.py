"""Holds a target frame rate in motion by less light and less resolution, as far as is needed.

Level 0 is what the user asked for, the next ones are the quicker entries of the ladder
(`iprt.settings.ladder`), and each one after them has fewer pixels. The time of a frame is
a + b·pixels, with a and b that depend on what is shown. Taken for b·pixels alone, it says too
little of a level with fewer pixels, where another step down follows, and too much of one with more:
going up never overshoots. A change makes buffers anew and histories begin afresh, so there is a
band between going down and up, and each step up that turns out wrong doubles the wait for the next
one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Any

from iprt.measure.tradeoff import Tradeoff
from iprt.settings.ladder import entry_settings
from iprt.settings.model import Settings
from iprt.settings.overrides import changed, plain_values

TRACED = ("light_scale", "trace.rays", "trace.object_rays")
"""Settings that most of the time of a frame depends on."""
SCALES = (0.84, 0.71, 0.6, 0.5, 0.42, 0.35, 0.3, 0.25)
"""Sides of the picture relative to the window's: each has 1/sqrt(2) of the pixels before."""
SKIPPED = 2
"""Frames after a change that do not count: buffers are made, histories and caches begin."""
FEWEST, WINDOW = 4, 16
"""Frames of which the newest must be too slow to go down, and that are averaged to go up."""
OUTLIER = 3.0
"""A frame counts as so many times the median at most: some only waited for something else."""
TOO_SLOW, ALL_TOO_SLOW = 1.1, 1.05
"""Means of the newest frames and of the window, over the time of a frame, at which to go down."""
ROOM_DOWN, ROOM_UP = 0.9, 0.8
"""Share of the time of a frame that a level may be expected to take to go down to it, or up."""
UP_S, MOST_UP_S = 2.0, 64.0
"""Seconds on a level before going up: at first, and at most."""


@dataclass(frozen=True)
class Preview:
    """Description of the quality that a picture in motion does without.

    Attributes
    ----------
    short : str
        `Preview at 50% resolution`.
    details : str
        All that differs.
    """

    short: str
    details: str


@dataclass(frozen=True, eq=False)
class Level:
    """Settings and resolution that are quicker than what the user asked for.

    Attributes
    ----------
    settings : Settings
        An object of its own, even if it equals that of another level.
    scale : float
        Sides of the picture relative to the window's, at most 1.
    share : float
        Time of a frame relative to level 0, roughly.
    preview : Preview or None
        What differs from what was asked for. None: nothing.
    """

    settings: Settings
    scale: float
    share: float
    preview: Preview | None


def levels_below(base: Settings, table: Tradeoff) -> tuple[Level, ...]:
    """From what was asked for down the ladder, then down in size.

    None has more of anything than `base`, nor another real world (`Features.of_real_world`), whose
    E_R is known already.
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
        if share == found[-1].share:  # what is left of an entry with more than was asked for
            del found[-1]
        given_up = fewer
        found.append(_preview(base, given_up, 1.0, share))
    last = found[-1].share
    found += [_preview(base, given_up, scale, last * scale**2) for scale in SCALES]
    return tuple(found)


def _ratio(own: Mapping[str, Any], table: Tradeoff) -> float:
    """Time of a frame with these settings relative to that of the entry `BALANCED`, roughly.

    That of the quickest entry which traces as much, or else of the slowest one.
    """
    enough = [
        entry.ratio[0]
        for entry in table.entries
        if not any(_less(key, entry_settings(entry.name)[key], own[key]) for key in TRACED)
    ]
    return min(enough, default=max(entry.ratio[0] for entry in table.entries))


def _less(key: str, value: Any, than: Any) -> bool:
    """A setting has less of what takes time than with another value."""
    return bool(value > than if key == "light_scale" else value < than)


def _preview(base: Settings, given_up: Mapping[str, Any], scale: float, share: float) -> Level:
    """A level with other settings and sides of the picture relative to the window's."""
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


class Pace:
    """Chooses settings and resolution by how long frames take.

    Parameters
    ----------
    target_fps : float
        Frames per second to hold; above 0.
    base : Settings
        What the user asked for. If that changes, make another `Pace`.
    table : Tradeoff
        Times of the ladder's entries.
    usual_s : float or None
        Seconds that a frame takes as the user asked for it, if that is known: then it begins on
        the level that this leads to.
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
        """Settings and size to render now."""
        return self.levels[self._now]

    def observe(self, seconds: float, compiled: bool) -> None:
        """Take note of a frame of the present level.

        Parameters
        ----------
        seconds : float
            That it took.
        compiled : bool
            Kernels were compiled for it, or buffers made: then its time says nothing.
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
        mean = fmean(min(time, OUTLIER * usual) for time in self._times)
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
        """The best level that should hold the target if frames of the present one take so long."""
        most = room * self._target_s / seconds * self.level.share
        fits = (number for number, level in enumerate(self.levels) if level.share <= most)
        return next(fits, len(self.levels) - 1)

    def _go(self, number: int) -> None:
        self._went_up = number < self._now
        self._now, self._frames, self._stood_s = number, 0, 0.0
        self._times: deque[float] = deque(maxlen=WINDOW)
