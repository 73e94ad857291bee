"""Playback of the video: frames are decoded ahead on a thread, and delivered when due.

In real time, late frames are dropped.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from iprt.errors import IprtError
from iprt.footage.frame import Frame
from iprt.footage.video.stream import Ahead
from iprt.scene.scene import Scene
from iprt.viewer.scene_light import LitScene
from iprt.viewer.shared_state import SharedState
from iprt.viewer.state import Playback, World

WAKE_S = 0.1
"""Polling interval of the thread in seconds, for frames to decode."""


@dataclass(frozen=True)
class _Ordered:
    """A frame in decoding, with its playback and its offset from the playback's first frame."""

    playback: Playback
    follower: int


class FrameFeed:
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
            self._stream = self.scene.stream(self._indices(), drift=self.drift, daylight=False)
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


class VideoPlayer:
    """A follower of the world's playback; all methods are called by one thread.

    Parameters
    ----------
    shared : SharedState
    problems : dict of str to str
        Messages by subject, here "video".
    clock : callable
        Returns seconds.

    Attributes
    ----------
    frame : Frame or None
        Frame to show, without light from outside; None before the first.
    fed : LitScene or None
        The scene whose frames are read.
    """

    def __init__(
        self, shared: SharedState, problems: dict[str, str], clock: Callable[[], float]
    ) -> None:
        self._shared, self._problems, self._clock = shared, problems, clock
        self._feed: FrameFeed | None = None
        self.fed: LitScene | None = None
        self._source: LitScene | None = None  # the scene of the frame
        self._unreadable: Playback | None = None  # playback with an unreadable frame
        self._given: Playback | None = None  # playback of the frame
        self.frame: Frame | None = None

    def close(self) -> None:
        """Stop decoding."""
        if self._feed is not None:
            self._feed.close()

    def arrived(self, playback: Playback) -> bool:
        """Return True if the playback's frame has arrived or is unreadable."""
        assert self._feed is not None
        return self._feed.arrived or self._unreadable == playback

    def position(self, playback: Playback) -> int:
        """Return the frame to show; callable from any thread."""
        frame, given = self.frame, self._given
        return playback.frame if frame is None or given != playback else frame.index

    @property
    def next_due_s(self) -> float | None:
        """Time at which the ready frame is due, by the clock; None without one."""
        return None if self._feed is None else self._feed.next_due_s

    def is_of(self, lit: LitScene) -> bool:
        """Return True if the frame is as in this scene but for the light from outside."""
        return self._source is not None and self._source.same_frames(lit)

    def follow(self, lit: LitScene, world: World, *, shown: bool) -> None:
        """Advance to the frame that is due.

        Parameters
        ----------
        lit : LitScene
        world : World
        shown : bool
            All clients see the current frame.
        """
        scene, playback = lit.scene, world.playback
        feed = self._feed_of(lit, world)
        feed.follow(playback, None if self.frame is None else self.frame.index)
        if self._unreadable == playback:
            return
        try:
            frame = feed.poll(shown=shown)
        except IprtError as error:
            self._problems["video"] = str(error)
            self._unreadable = playback
            return
        if frame is not None:
            self.frame, self._source = frame, self.fed
            self._problems.pop("video", None)
        if feed.arrived:
            self._given = playback
        self._stop_at_the_end(scene, playback, shown=shown and frame is None)

    def _feed_of(self, lit: LitScene, world: World) -> FrameFeed:
        drift = world.settings.drift and len(lit.scene.frame_indices) > 1
        feed, fed = self._feed, self.fed
        if feed is None or fed is None or feed.drift != drift or not fed.same_frames(lit):
            if feed is not None:
                feed.close()
            wake = self._shared.stir
            feed = FrameFeed(lit.scene, world.playback, drift=drift, clock=self._clock, wake=wake)
            self._feed, self.fed, self._unreadable = feed, lit, None
        return feed

    def _stop_at_the_end(self, scene: Scene, playback: Playback, *, shown: bool) -> None:
        """Pause at the end of the video, so that the last frame is refined at full quality."""
        if not playback.playing or playback.loop or self.frame is None:
            return
        frames = scene.frame_indices
        due = playback.index(playback.due(self._clock(), scene.source.fps), frames)
        if playback.mode == "every frame":
            due = self.position(playback) if shown else frames[0]
        if due == self.frame.index == frames[-1]:
            self._shared.play_as(playback, Playback(frames[-1], None, playback.mode))
