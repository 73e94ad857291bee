"""Frames of video files by time: sought once, then decoded in order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any, cast

from iprt.errors import FormatError
from iprt.files.untrusted import MAX_PIXELS
from iprt.footage.video.container import StreamInfo, ffmpeg_decoding, opened, stamp_of, time_base

if TYPE_CHECKING:
    import av
    from av.container import InputContainer
    from av.video.stream import VideoStream

FAR_S = 2
"""Seconds ahead from which on a seek is taken to be quicker than decoding all in between."""


@dataclass(frozen=True)
class _Shown:
    """A frame with its time; without a frame, one that should be there and cannot be decoded."""

    time: Fraction
    frame: av.VideoFrame | None


@dataclass(frozen=True)
class _Expected:
    """A frame whose packet has been decoded: its number in that order; whether none needs it."""

    order: int
    disposable: bool


class StreamReader:
    """The frames of a stream by time; quickest in order, which never seeks.

    Parameters
    ----------
    container : InputContainer
        For this reader alone.

    Attributes
    ----------
    seeks : int
        How many there have been.
    """

    def __init__(self, container: InputContainer, info: StreamInfo) -> None:
        self._container, self._info = container, info
        self._stream = cast("VideoStream", container.streams[info.number])
        # Several frames at a time are quickest; but FFV1 then now and then gives a frame before a
        # damaged one the content of another.
        is_ffv1 = self._stream.codec_context.name == "ffv1"
        self._stream.thread_type = "SLICE" if is_ffv1 else "AUTO"
        # Damage must not pass for a picture; and a stream may be larger than its headers claim.
        self._stream.codec_context.options = {
            "err_detect": "crccheck",
            "max_pixels": str(MAX_PIXELS),
        }
        self._base = time_base(self._stream)
        self.seeks = 0
        self._restart()

    def at(self, time: Fraction) -> av.VideoFrame:
        """The frame that is shown nearest to a time; of two as near, the earlier.

        Raises
        ------
        FormatError
            That frame is damaged, or nothing can be decoded.
        """
        with ffmpeg_decoding(self._info.path, "damaged or cut off video"):
            if self._is_elsewhere(time):
                self._seek(time)
            self._advance(time)
        if not self._window:
            raise FormatError(f"{self._info.path}: holds no frame that can be decoded")
        near = self._window[0]
        for later in self._window[1:]:
            # Times are rounded to what the file can store, which must not decide between equals.
            if abs(later.time - time) + self._base < abs(near.time - time):
                near = later
        if near.frame is None:
            seconds = float(near.time - self._info.start)
            raise FormatError(f"{self._info.path}: the frame at {seconds:.3f} s is damaged")
        return near.frame

    def _restart(self) -> None:
        """Go on decoding from where the container is."""
        self._window: list[_Shown] = []
        self._frames = self._decoded()

    def _is_elsewhere(self, time: Fraction) -> bool:
        if not self._window:
            return time > self._info.start + FAR_S
        return time < self._window[0].time or time > self._window[-1].time + FAR_S

    def _seek(self, time: Fraction) -> None:
        """Make the window begin with a frame at or before a time, if there is one.

        A seek may come out too late, or where frames cannot be decoded yet: between key frames, or
        before a key frame that the ones shown ahead of it do not rely on alone (open groups).
        """
        back = Fraction(0)
        while True:
            at_start = time - back <= self._info.start
            self._seek_container(max(time - back, self._info.start))
            if at_start:
                # Some formats look for the time of decoding, which is before that of showing;
                # others refuse what is before the first frame.
                with suppress(FormatError):
                    self._seek_container(self._info.start - FAR_S)
            self._restart()
            first = next((s for s in self._frames if at_start or s.frame is not None), None)
            self._window = [] if first is None else [first]
            if at_start or (first is not None and first.time <= time):
                return
            back = max(2 * back, Fraction(1))

    def _seek_container(self, time: Fraction) -> None:
        with ffmpeg_decoding(self._info.path, "cannot be searched"):
            self._container.seek(int(time / self._base), stream=self._stream)
        self.seeks += 1

    def _advance(self, time: Fraction) -> None:
        """Decode up to the first frame at or after a time; keep what is next to the time."""
        while not self._window or self._window[-1].time < time:
            shown = next(self._frames, None)
            if shown is None:
                return
            self._window.append(shown)
            before = [i for i, other in enumerate(self._window) if other.time <= time]
            del self._window[: before[-1] if before else 0]

    def _decoded(self) -> Iterator[_Shown]:
        """Frames in the order of their times, those that are damaged among them.

        What is decoded after a damaged frame may be predicted from it: all up to the next key frame
        counts as damaged, unless that frame was none that others are predicted from.
        """
        import av

        expected: dict[int, _Expected] = {}
        damaged_from: int | None = None
        for order, packet in enumerate(self._packets()):
            stamp = stamp_of(packet)
            if stamp is not None and not packet.is_discard:
                expected[stamp] = _Expected(order, packet.is_disposable)
            try:
                frames = self._stream.codec_context.decode(packet if packet.size else None)
            except av.FFmpegError:
                continue
            for frame in frames:
                at = stamp_of(frame)
                if at is None:
                    continue
                own = expected.pop(at, _Expected(order, False))
                # What is still expected from before has been lost in the decoder.
                lost = {other: expected.pop(other) for other in sorted(expected) if other < at}
                orders = [other.order for other in lost.values() if not other.disposable]
                if frame.is_corrupt and not own.disposable:
                    orders.append(own.order)
                damaged_from = min(orders, default=damaged_from)
                if frame.key_frame and not frame.is_corrupt:
                    damaged_from = None
                for other in lost:
                    yield _Shown(other * self._base, None)
                late = damaged_from is not None and own.order >= damaged_from
                yield _Shown(at * self._base, None if late or frame.is_corrupt else frame)
        for other in sorted(expected):
            yield _Shown(other * self._base, None)

    def _packets(self) -> Iterator[Any]:
        """The stream's packets, and an empty one at its end, or where the file is damaged."""
        import av

        try:
            yield from self._container.demux(self._stream)
        except av.FFmpegError:
            yield av.Packet()


Streams = Callable[[StreamInfo], StreamReader]


@contextmanager
def open_streams() -> Iterator[Streams]:
    """The reader of a stream, which is opened when it is first asked for, once.

    It raises FormatError where the file cannot be read.
    """
    with ExitStack() as stack:
        yield cache(lambda info: StreamReader(stack.enter_context(opened(info.path)), info))
