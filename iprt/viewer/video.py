"""The current frame of the video during playback."""

from __future__ import annotations

from collections.abc import Callable

from iprt.errors import IprtError
from iprt.footage.frame import Frame
from iprt.scene.scene import Scene
from iprt.viewer.feed import Feed
from iprt.viewer.files import Loaded
from iprt.viewer.mailbox import Mailbox
from iprt.viewer.state import Playback, World


class Video:
    """A follower of the world's playback; all methods are called by one thread.

    Parameters
    ----------
    mailbox : Mailbox
    problems : dict of str to str
        Messages by subject, here "video".
    clock : callable
        Returns seconds.

    Attributes
    ----------
    frame : Frame or None
        Frame to show, or None before the first.
    """

    def __init__(
        self, mailbox: Mailbox, problems: dict[str, str], clock: Callable[[], float]
    ) -> None:
        self._mailbox, self._problems, self._clock = mailbox, problems, clock
        self._feed: Feed | None = None
        self._fed: Loaded | None = None  # the scene of the feed
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

    def follow(self, loaded: Loaded, world: World, *, shown: bool) -> None:
        """Advance to the frame that is due.

        Parameters
        ----------
        loaded : Loaded
        world : World
        shown : bool
            All clients see the current frame.
        """
        scene, playback = loaded.scene, world.playback
        feed = self._feed_of(loaded, world)
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
            self.frame = frame
            self._problems.pop("video", None)
        if feed.arrived:
            self._given = playback
        self._stop_at_the_end(scene, playback, shown=shown and frame is None)

    def _feed_of(self, loaded: Loaded, world: World) -> Feed:
        scene = loaded.scene
        drift = world.settings.drift and len(scene.frame_indices) > 1
        feed, fed = self._feed, self._fed
        if feed is None or fed is None or feed.drift != drift or not fed.same_video(loaded):
            if feed is not None:
                feed.close()
            wake = self._mailbox.stir
            feed = Feed(scene, world.playback, drift=drift, clock=self._clock, wake=wake)
            self._feed, self._fed, self._unreadable = feed, loaded, None
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
            self._mailbox.play_as(playback, Playback(frames[-1], None, playback.mode))
