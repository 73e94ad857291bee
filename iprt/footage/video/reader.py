"""Reading of video frames by time: seek once, then decode in order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any, cast

from iprt.errors import FormatError
from iprt.files.safe_reading import MAX_PIXELS
from iprt.footage.video.container import StreamInfo, ffmpeg_decoding, opened, stamp_of, time_base

if TYPE_CHECKING:
    import av
    from av.container import InputContainer
    from av.video.stream import VideoStream

FAR_S = 2
"""Least distance ahead, in seconds, at which seeking is assumed quicker than decoding."""


@dataclass(frozen=True)
class _Shown:
    """Frame with its time; None for a frame that cannot be decoded."""

    time: Fraction
    frame: av.VideoFrame | None


@dataclass(frozen=True)
class _Expected:
    """Frame whose packet was decoded: decoding order, and whether no other frame depends on it."""

    order: int
    disposable: bool


class StreamReader:
    """A reader of a stream's frames by time; quickest in order, which never seeks.

    Parameters
    ----------
    container : InputContainer
        Open file, used by this reader alone.
    info : StreamInfo
        The stream.

    Attributes
    ----------
    seeks : int
        Number of seeks so far.
    """

    def __init__(self, container: InputContainer, info: StreamInfo) -> None:
        self._container, self._info = container, info
        self._stream = cast("VideoStream", container.streams[info.number])
        # Frame threads are the quickest. With FFV1, however, they occasionally give a frame before
        # a damaged one the content of another frame.
        is_ffv1 = self._stream.codec_context.name == "ffv1"
        self._stream.thread_type = "SLICE" if is_ffv1 else "AUTO"
        # Damage must be detected, and a stream may be larger than its headers claim.
        self._stream.codec_context.options = {
            "err_detect": "crccheck",
            "max_pixels": str(MAX_PIXELS),
        }
        self._base = time_base(self._stream)
        self.seeks = 0
        self._restart()

    def at(self, time: Fraction) -> av.VideoFrame:
        """Return the frame nearest to a time; the earlier one if two are equally near.

        Raises
        ------
        FormatError
            If that frame is damaged, or nothing can be decoded.
        """
        with ffmpeg_decoding(self._info.path, "damaged or cut off video"):
            if self._is_elsewhere(time):
                self._seek(time)
            self._advance(time)
        if not self._window:
            raise FormatError(f"{self._info.path}: holds no frame that can be decoded")
        near = self._window[0]
        for later in self._window[1:]:
            # File formats round times, which must not decide between equally near frames.
            if abs(later.time - time) + self._base < abs(near.time - time):
                near = later
        if near.frame is None:
            seconds = float(near.time - self._info.start)
            raise FormatError(f"{self._info.path}: the frame at {seconds:.3f} s is damaged")
        return near.frame

    def _restart(self) -> None:
        """Restart decoding at the container's current position."""
        self._window: list[_Shown] = []
        self._frames = self._decoded()

    def _is_elsewhere(self, time: Fraction) -> bool:
        if not self._window:
            return time > self._info.start + FAR_S
        return time < self._window[0].time or time > self._window[-1].time + FAR_S

    def _seek(self, time: Fraction) -> None:
        """Seek so that the window begins with a frame at or before a time, if there is one.

        A seek may end too late, or where frames cannot be decoded yet: between key frames, or at a
        key frame whose leading frames depend on earlier ones (open groups of pictures).
        """
        back = Fraction(0)
        while True:
            at_start = time - back <= self._info.start
            self._seek_container(max(time - back, self._info.start))
            if at_start:
                # Some formats seek by decoding time, which precedes presentation. Others refuse
                # times before the first frame.
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
        """Decode up to the first frame at or after a time; keep the frames next to the time."""
        while not self._window or self._window[-1].time < time:
            shown = next(self._frames, None)
            if shown is None:
                return
            self._window.append(shown)
            before = [i for i, other in enumerate(self._window) if other.time <= time]
            del self._window[: before[-1] if before else 0]

    def _decoded(self) -> Iterator[_Shown]:
        """Iterate over frames in presentation order, damaged ones included.

        Frames after a damaged one may be predicted from it. All frames up to the next key frame
        count as damaged, unless no other frame depends on the damaged one.
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
                # Frames still expected from before were lost in the decoder.
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
        """Iterate over packets; the last one is empty, at the stream's end or at damage."""
        import av

        try:
            yield from self._container.demux(self._stream)
        except av.FFmpegError:
            yield av.Packet()


Streams = Callable[[StreamInfo], StreamReader]


@contextmanager
def open_streams() -> Iterator[Streams]:
    """Open a function that returns the reader of a stream, created once, on first use.

    The function raises FormatError if the file cannot be read.
    """
    with ExitStack() as stack:
        yield cache(lambda info: StreamReader(stack.enter_context(opened(info.path)), info))
