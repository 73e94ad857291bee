"""Video files through FFmpeg (PyAV): what streams they hold, and their frames by time.

Files may come from anybody. FFmpeg reads nothing but the file itself: it gets an open file instead
of a name, every further file that it would open is refused, and formats that do nothing but name
other files (playlists, HLS, DASH, concat) are not read.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, cast

from iprt.errors import FormatError
from iprt.scene.images import file_kind
from iprt.scene.manifest_problems import FRAME_PATTERN, PICTURE_SUFFIXES
from iprt.scene.untrusted import (
    MAX_PIXELS,
    decoding,
    is_file,
    open_file,
    require_picture_size,
)

if TYPE_CHECKING:
    import av
    from av.container import InputContainer
    from av.video.stream import VideoStream

FORMATS = "matroska,webm,mov,mp4,avi,mpegts,mxf,nut,ivf,flv,asf,ogg,mpeg,yuv4mpegpipe"
"""FFmpeg's demuxers that read pictures out of the very file."""
BUFFER_BYTES = 2**20
MAX_STREAMS = 64
LONGEST_SEARCH = 4096
"""Packets at the end of a file that are looked through for the last frame."""
FAR_S = 2
"""Seconds ahead from which on a seek is taken to be quicker than decoding all in between."""


@dataclass(frozen=True)
class StreamInfo:
    """A video stream, by what its headers say.

    Attributes
    ----------
    path : Path
    number : int
        Of the stream in the file.
    width, height : int
    pixels : str
        FFmpeg's name of the pixel format.
    start, last : Fraction
        Times of the first and the last frame in seconds, on the file's clock.
    rate : Fraction
        Frames per second, in the mean.
    claimed : Fraction or None
        Seconds from the first to the end of the last frame, as the headers have it.
    """

    path: Path
    number: int
    width: int
    height: int
    pixels: str
    start: Fraction
    last: Fraction
    rate: Fraction
    claimed: Fraction | None

    @property
    def is_grey(self) -> bool:
        return self.pixels.startswith("gray")

    @property
    def is_deep_grey(self) -> bool:
        """Whether it can hold depth: one channel of more than 8 bits."""
        return self.is_grey and self.pixels != "gray"


def is_container(root: Path, name: str) -> bool:
    """Whether a file that `[video]` names is there and no picture.

    What is neither a picture nor a video counts as a video, whose reader tells so.
    """
    path = root / name
    if FRAME_PATTERN.search(name) or name.lower().endswith(PICTURE_SUFFIXES) or not is_file(path):
        return False
    try:
        file_kind(path)
    except FormatError:
        return True
    return False


@contextmanager
def opened(path: Path) -> Iterator[InputContainer]:
    """A video file, opened by FFmpeg.

    Raises
    ------
    FormatError
        Not a video, or of a format that is not read.
    """
    import av

    av.logging.set_level(None)  # what FFmpeg says of damage is told once by us
    with open_file(path) as file:
        with _decoding(path, "not an EXR, PNG, JPEG or PFM file, nor a video that can be read"):
            container = av.open(
                file,
                metadata_errors="replace",
                options={
                    "format_whitelist": FORMATS,
                    "protocol_whitelist": "none",
                    "max_pixels": str(MAX_PIXELS),
                },
                io_open=_refuse,
                buffer_size=BUFFER_BYTES,
            )
        assert isinstance(container, av.container.InputContainer)
        try:
            yield container
        finally:
            container.close()


@contextmanager
def _decoding(path: Path, complaint: str) -> Iterator[None]:
    """As `decoding`; of FFmpeg's errors, lack of memory among them, only the reason is told."""
    import av

    with decoding(path, complaint):
        try:
            yield
        except av.FFmpegError as error:
            raise FormatError(f"{path}: {complaint} ({error.strerror})") from error


def _refuse(url: str, *_: Any) -> NoReturn:
    raise PermissionError(f"{url}: a video may not name other files")


def video_streams(path: Path) -> list[StreamInfo]:
    """The video streams of a file; cover pictures are none.

    Raises
    ------
    FormatError
        Not a video, without a video stream, or with pictures larger than are read.
    """
    with opened(path) as container:
        streams = container.streams.video[:MAX_STREAMS]
        found = []
        for stream in streams:
            context = stream.codec_context
            if "attached_pic" in str(stream.disposition).lower() or context is None:
                continue
            require_picture_size(path, context.width, context.height)
            with _decoding(path, "damaged or cut off video"):
                found.append(_info(path, container, stream))
    if not found:
        raise FormatError(f"{path}: holds no video stream")
    return found


def _info(path: Path, container: InputContainer, stream: Any) -> StreamInfo:
    base = _base(stream)
    rate = stream.average_rate or stream.guessed_rate or stream.base_rate
    start = Fraction(stream.start_time or 0) * base
    claimed = None
    if stream.duration is not None:
        claimed = Fraction(stream.duration) * base
    elif container.duration is not None:
        claimed = Fraction(container.duration, 1_000_000)
    if not rate or rate <= 0:
        raise FormatError(f"{path}: does not say how many frames it shows per second")
    return StreamInfo(
        path=path,
        number=stream.index,
        width=stream.codec_context.width,
        height=stream.codec_context.height,
        pixels=stream.codec_context.pix_fmt or "",
        start=start,
        last=max(start, _last_time(container, stream, start + (claimed or 0))),
        rate=rate,
        claimed=claimed,
    )


def _last_time(container: InputContainer, stream: Any, end: Fraction) -> Fraction:
    """The time of the last frame that is in the file, which may be cut off before it should end."""
    import av

    base = _base(stream)
    with suppress(av.FFmpegError):
        container.seek(int(end / base), stream=stream)
    last = Fraction(0)
    with suppress(av.FFmpegError):
        for count, packet in enumerate(container.demux(stream)):
            stamp = _stamp(packet)
            if stamp is not None:
                last = max(last, stamp * base)
            if count > LONGEST_SEARCH:
                break
    return last


def _base(stream: Any) -> Fraction:
    """Seconds per step of a stream's times."""
    return Fraction(stream.time_base or Fraction(1, 1_000_000))


def _stamp(timed: Any) -> int | None:
    """When a packet or frame is shown, in its time base; AVI knows only when it is decoded."""
    stamp: int | None = timed.pts if timed.pts is not None else timed.dts
    return stamp


@dataclass(frozen=True)
class _Shown:
    """A frame with its time; without a frame, one that should be there and cannot be decoded."""

    time: Fraction
    frame: av.VideoFrame | None


class StreamReader:
    """The frames of a stream by time; quickest in order, which never seeks.

    Parameters
    ----------
    container : InputContainer
        For this reader alone.
    info : StreamInfo

    Attributes
    ----------
    seeks : int
        How many there have been.
    """

    def __init__(self, container: InputContainer, info: StreamInfo) -> None:
        self._container, self._info = container, info
        self._stream = cast("VideoStream", container.streams[info.number])
        self._stream.thread_type = "AUTO"
        # Damage must not pass for a picture; and a stream may be larger than its headers claim.
        self._stream.codec_context.options = {
            "err_detect": "crccheck",
            "max_pixels": str(MAX_PIXELS),
        }
        self.seeks = 0
        self._restart()

    def at(self, time: Fraction) -> av.VideoFrame:
        """The frame that is shown nearest to a time; of two as near, the earlier.

        Raises
        ------
        FormatError
            That frame is damaged, or nothing can be decoded.
        """
        with _decoding(self._info.path, "damaged or cut off video"):
            if self._is_elsewhere(time):
                self._seek(time)
            self._advance(time)
        near = min(self._window, key=lambda shown: abs(shown.time - time), default=None)
        if near is None:
            raise FormatError(f"{self._info.path}: holds no frame that can be decoded")
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
        """Make the window begin at or before a time, if anything does."""
        base, back = _base(self._stream), Fraction(0)
        while True:
            target = max(time - back, self._info.start)
            self._container.seek(int(target / base), stream=self._stream)
            self.seeks += 1
            self._restart()
            first = next(self._frames, None)
            if first is not None:
                self._window = [first]
            if target <= self._info.start or (first is not None and first.time <= time):
                return
            # Seeking goes by key frames that an index has, and may come out too late.
            back = max(2 * back, Fraction(1))

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
        """Frames in the order of their times, those that are damaged among them."""
        import av

        base = _base(self._stream)
        expected: set[int] = set()
        for packet in self._packets():
            stamp = _stamp(packet)
            if stamp is not None and not packet.is_discard:
                expected.add(stamp)
            try:
                frames = self._stream.codec_context.decode(packet if packet.size else None)
            except av.FFmpegError:
                continue
            for frame in frames:
                at = _stamp(frame)
                if at is None:
                    continue
                # What is still expected from before has been lost in the decoder.
                for lost in sorted(other for other in expected if other < at):
                    yield _Shown(lost * base, None)
                expected = {other for other in expected if other > at}
                yield _Shown(at * base, None if frame.is_corrupt else frame)
        for lost in sorted(expected):
            yield _Shown(lost * base, None)

    def _packets(self) -> Iterator[Any]:
        """The stream's packets, and an empty one at its end, or where the file is damaged."""
        import av

        try:
            yield from self._container.demux(self._stream)
        except av.FFmpegError:
            yield av.Packet()


class OpenStreams:
    """A context manager that opens streams when they are first asked for, each once."""

    def __enter__(self) -> OpenStreams:
        self._stack = ExitStack()
        self._readers: dict[tuple[Path, int], StreamReader] = {}
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def reader(self, info: StreamInfo) -> StreamReader:
        """The stream's reader.

        Raises
        ------
        FormatError
        """
        key = info.path, info.number
        if key not in self._readers:
            container = self._stack.enter_context(opened(info.path))
            self._readers[key] = StreamReader(container, info)
        return self._readers[key]
