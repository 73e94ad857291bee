"""Decoding of the video's frames ahead on a thread, and their delivery when due.

In real time, late frames are dropped.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Self

from iprt.footage.frame import Frame
from iprt.footage.video.stream import Ahead
from iprt.scene.scene import Scene
from iprt.viewer.state import Playback

WAKE_S = 0.1
"""Polling interval of the thread in seconds, for frames to decode."""


@dataclass(frozen=True)
class _Ordered:
    """A frame in decoding, with its playback and its offset from the playback's first frame."""

    playback: Playback
    follower: int


class Feed:
    """A source of a scene's video frames for a playback; it never waits for a decoder.

    Parameters
    ----------
    scene : Scene
    playback : Playback
    drift : bool
        See `Scene.stream`.
    clock : callable
        Returns seconds, on the playback's clock.
    wake : callable
        Called by the thread when a frame is ready.

    Attributes
    ----------
    arrived : bool
        True if a frame of the current playback has been delivered.
    """

    def __init__(
        self,
        scene: Scene,
        playback: Playback,
        *,
        drift: bool,
        clock: Callable[[], float],
        wake: Callable[[], None],
    ) -> None:
        self.scene, self.drift = scene, drift
        self._clock, self._wake = clock, wake
        self._frames, self._fps = scene.frame_indices, scene.source.fps
        self._condition = threading.Condition()
        self._playback = playback
        self._ordered: deque[_Ordered] = deque()
        self._last: _Ordered | None = None
        self._closed = False
        self._held: tuple[int, Frame] | None = None
        self._given_s = self._clock()  # time of the last delivery
        self.arrived = False
        self._stream: Ahead[Frame] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the thread."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()
        self._end_stream()

    def follow(self, playback: Playback, shown: int | None) -> None:
        """Switch to another playback, and drop frames decoded for the old one.

        Parameters
        ----------
        playback : Playback
        shown : int or None
            The last delivered frame, which is not delivered again.
        """
        with self._condition:
            if playback == self._playback:
                return
            self._playback, self._held, self._given_s = playback, None, self._clock()
            self.arrived = shown == playback.index(0, self._frames)
            if self.arrived:
                self._last = _Ordered(playback, 0)
            self._condition.notify_all()

    def poll(self, *, shown: bool = True) -> Frame | None:
        """Return the newest frame that is due and not yet delivered, or None.

        Parameters
        ----------
        shown : bool
            Every client has seen the last frame. In "every frame" mode, the next one is due only
            then.

        Raises
        ------
        FormatError
            A frame cannot be read and there is none before it. The next call tries again.
        """
        stream = self._opened()
        newest: Frame | None = None
        try:
            while True:
                if self._held is None and not self._fetch(stream):
                    return newest
                assert self._held is not None
                follower, frame = self._held
                if not self._is_due(follower, shown=shown and newest is None):
                    return newest
                newest, self._held, self.arrived = frame, None, True
                self._given_s = self._clock()
        except Exception:
            self._end_stream()
            raise

    def _is_due(self, follower: int, *, shown: bool) -> bool:
        playback, now = self._playback, self._clock()
        if playback.mode == "real time" or not playback.playing:
            return follower <= playback.due(now, self._fps)
        # The tolerance covers rounding in sums of frame times.
        return follower == 0 or (shown and now - self._given_s >= (1.0 - 1e-6) / self._fps)

    @property
    def next_due_s(self) -> float | None:
        """Time at which the ready frame is due, by the clock; None without one."""
        playback = self._playback
        if self._held is None or playback.since_s is None:
            return None
        if playback.mode == "every frame":
            return self._given_s + 1.0 / self._fps
        return playback.since_s + self._held[0] / self._fps

    def _fetch(self, stream: Ahead[Frame]) -> bool:
        """Hold the next frame of this playback; return True if one is ready."""
        while (frame := stream.ready()) is not None:
            ordered = self._ordered.popleft()
            if ordered.playback == self._playback:
                self._held = ordered.follower, frame
                return True
        return False

    def _opened(self) -> Ahead[Frame]:
        if self._stream is None:
            self._stream = self.scene.stream(self._indices(), drift=self.drift)
            self._stream.__enter__()
        return self._stream

    def _end_stream(self) -> None:
        stream, self._stream = self._stream, None
        if stream is not None:
            with self._condition:
                ending, self._closed = self._closed, True
                self._condition.notify_all()
            stream.__exit__(None, None, None)
            self._closed = ending
        self._ordered.clear()
        self._last = self._held = None

    # On the stream's thread -------------------------------------------------------------------

    def _indices(self) -> Iterator[int]:
        """Yield the frames to decode, each just before its decoding."""
        while True:
            # Asking for the next frame means that the previous one is ready.
            self._wake()
            with self._condition:
                while (ordered := self._next()) is None and not self._closed:
                    self._condition.wait(WAKE_S)
                if ordered is None or self._closed:
                    return
                self._last = ordered
                self._ordered.append(ordered)
            yield ordered.playback.index(ordered.follower, self._frames)

    def _next(self) -> _Ordered | None:
        """Return the frame to decode now, or None."""
        playback, last = self._playback, self._last
        real_time = playback.mode == "real time"
        due = playback.due(self._clock(), self._fps) if real_time else 0
        if last is None or last.playback != playback:
            return _Ordered(playback, due)
        if playback.since_s is None:
            return None
        follower = max(last.follower + 1, due)
        at_end = playback.index(follower, self._frames)
        shown = playback.index(last.follower, self._frames)
        if len(self._frames) == 1 or (at_end == shown and not playback.loop):
            return None  # the last frame stays
        return _Ordered(playback, follower)
