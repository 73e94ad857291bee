"""How often something happens, and where a video that plays has come to."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

EVENTS = 12
"""Number of events that the mean is taken of."""


class Rate:
    """Events per second, of late.

    Parameters
    ----------
    clock : callable
        Seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._times: deque[float] = deque(maxlen=EVENTS)

    def add(self) -> None:
        """It happened now."""
        self._times.append(self._clock())

    def clear(self) -> None:
        self._times.clear()

    @property
    def value(self) -> float | None:
        """None: it has not happened twice."""
        if len(self._times) < 2 or self._times[-1] <= self._times[0]:
            return None
        return (len(self._times) - 1) / (self._times[-1] - self._times[0])


class FrameRate:
    """Frames of a video that are shown per second, while it plays."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._rate = Rate(clock)
        self._last: tuple[float | None, int] = (None, -1)

    def follow(self, since_s: float | None, frame: int) -> None:
        """Take note of a picture; `since_s` is that of the playback."""
        if since_s is None or since_s != self._last[0]:
            self._rate.clear()
        if (since_s, frame) != self._last:
            self._rate.add()
        self._last = since_s, frame

    @property
    def value(self) -> float | None:
        return None if self._last[0] is None else self._rate.value


@dataclass(frozen=True)
class FrameCounter:
    """Where a video is.

    Attributes
    ----------
    frame : int
        Number of the frame that is shown, as scene.toml counts.
    position, total : int
        Which one that is, from 1 on, and how many there are.
    shown_fps : float or None
        Frames of the video that are shown per second. None: it does not play, or has only begun.
    video_fps : float
        Those of the video itself.
    """

    frame: int
    position: int
    total: int
    shown_fps: float | None
    video_fps: float

    @property
    def text(self) -> str:
        """In a few words."""
        where = f"{self.position} of {self.total}"
        if self.shown_fps is None:
            return where
        return f"{where}, {self.shown_fps:.2g} of {self.video_fps:g} fps"
