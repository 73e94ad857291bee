"""Rates of events and of video frames."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

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
