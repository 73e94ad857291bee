"""Holds a target frame rate in motion by less light and less resolution, as far as is needed.

Level 0 is what the user asked for, level 1 has few rays, the next ones have light for blocks of
pixels, and each one after them fewer pixels. The time of a frame is a + b·pixels, with a and b
that no one knows. Taken for b·pixels alone, it says too little of a level with fewer pixels, where
another step down follows, and too much of one with more: going up never overshoots. A change makes
buffers anew and histories begin afresh, so there is a band between going down and up, and each step
up that turns out wrong doubles the wait for the next one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Any

from iprt.settings.model import Settings
from iprt.settings.overrides import changed, plain_values

FEW_RAYS = {
    "trace.rays": 1,
    "trace.object_rays": 1,
    "iprt.ratio_rows": 16,
}
"""What takes time and shows little in motion. None of it needs a real world other than that of
the picture at rest (`Features.of_real_world`), whose E_R is known already."""
RAYS_SHARE = 0.75
"""Time of a frame with few rays, relative to that with the default settings."""
LIGHT_SHARES = {1: 1.0, 2: 0.55, 4: 0.32}
"""The same of a frame by its `light_scale`. Outlines and the panorama stay sharp."""
FILTER_LEVELS = {1: 5, 2: 4, 4: 3}
"""`atrous.levels` at most: the filter reaches as far across the picture."""
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


def levels_below(base: Settings) -> tuple[Level, ...]:
    """From what was asked for down. None has more of anything than `base`."""
    own = plain_values(base)
    given_up = {key: value for key, value in FEW_RAYS.items() if value < own[key]}
    found = [Level(base, 1.0, 1.0, None)]
    share = 1.0
    if given_up:
        share = RAYS_SHARE
        found.append(_preview(base, given_up, 1.0, share))
    lit = LIGHT_SHARES[max(scale for scale in LIGHT_SHARES if scale <= base.light_scale)]
    for scale, of_frame in LIGHT_SHARES.items():
        if scale > base.light_scale:
            levels = min(FILTER_LEVELS[scale], base.atrous.levels)
            given_up = given_up | {"light_scale": scale, "atrous.levels": levels}
            share *= of_frame / lit
            lit = of_frame
            found.append(_preview(base, given_up, 1.0, share))
    found += [_preview(base, given_up, scale, share * scale**2) for scale in SCALES]
    return tuple(found)


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
    usual_s : float or None
        Seconds that a frame takes as the user asked for it, if that is known: then it begins on
        the level that this leads to.
    """

    def __init__(self, target_fps: float, base: Settings, *, usual_s: float | None = None) -> None:
        self.base = base
        self.levels: Sequence[Level] = levels_below(base)
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
