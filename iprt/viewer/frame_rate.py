"""Rates of events, and the position in a playing video."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

EVENTS = 12
"""Number of averaged events."""


class EventRate:
    """The recent rate of an event per second.

    Parameters
    ----------
    clock : callable
        Returns seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._times: deque[float] = deque(maxlen=EVENTS)

    def add(self) -> None:
        """Record an event at the current time."""
        self._times.append(self._clock())

    def clear(self) -> None:
        """Forget all events."""
        self._times.clear()

    @property
    def value(self) -> float | None:
        """Events per second, or None before the second event."""
        if len(self._times) < 2 or self._times[-1] <= self._times[0]:
            return None
        return (len(self._times) - 1) / (self._times[-1] - self._times[0])


class FrameRate:
    """The rate of displayed video frames during playback."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._rate = EventRate(clock)
        self._last: tuple[float | None, int] = (None, -1)

    def follow(self, since_s: float | None, frame: int) -> None:
        """Record a picture; `since_s` belongs to the playback."""
        if since_s is None or since_s != self._last[0]:
            self._rate.clear()
        if (since_s, frame) != self._last:
            self._rate.add()
        self._last = since_s, frame

    @property
    def value(self) -> float | None:
        """Frames per second; None if paused or before the second frame."""
        return None if self._last[0] is None else self._rate.value


@dataclass(frozen=True)
class FrameCounter:
    """The position in a video.

    Attributes
    ----------
    frame : int
        Number of the displayed frame, as in scene.toml.
    position, total : int
        Position counted from 1, and number of frames.
    shown_fps : float or None
        Displayed video frames per second; None if paused or at the start.
    video_fps : float
        Frame rate of the video itself.
    """

    frame: int
    position: int
    total: int
    shown_fps: float | None
    video_fps: float

    @property
    def text(self) -> str:
        """Short text for display."""
        where = f"{self.position} of {self.total}"
        if self.shown_fps is None:
            return where
        return f"{where}, {self.shown_fps:.2g} of {self.video_fps:g} fps"
