"""Access to video files through FFmpeg (PyAV): headers of their streams.

Files are untrusted. FFmpeg reads nothing but the file itself. It gets an open file instead of a
name, every further file that it would open is refused, and formats that only name other files
(playlists, HLS, DASH, concat) are not read.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from iprt.errors import FormatError
from iprt.files.kinds import FRAME_PATTERN, PICTURE_SUFFIXES, READ, file_kind
from iprt.files.safe_reading import MAX_PIXELS, decoding, is_file, open_file, require_picture_size

if TYPE_CHECKING:
    from av.container import InputContainer

FORMATS = "matroska,webm,mov,mp4,avi,mpegts,mxf,nut,ivf,flv,asf,ogg,mpeg,yuv4mpegpipe"
"""FFmpeg's demuxers of formats that hold their pictures in the file itself."""
BUFFER_BYTES = 2**20
MAX_STREAMS = 64
LONGEST_SEARCH = 4096
"""Largest number of packets at the end of a file that are searched for the last frame."""
NEITHER = f"not an {READ} file, nor a video that can be read"
LAST_S = 2
"""Seconds before the end of a file that are searched for the last frame."""


@dataclass(frozen=True)
class StreamInfo:
    """A video stream, as described by its headers.

    Attributes
    ----------
    path : Path
        The file.
    number : int
        The stream's index in the file.
    width, height : int
        Size of the pictures.
    pixels : str
        FFmpeg's name of the pixel format.
    transfer : int
        Transfer characteristics (H.273).
    start, last : Fraction
        Times of the first and the last frame in seconds, on the file's clock.
    rate : Fraction
        Mean number of frames per second.
    claimed : Fraction or None
        Seconds from the first frame to the end of the last one, according to the headers.
    """

    path: Path
    number: int
    width: int
    height: int
    pixels: str
    transfer: int
    start: Fraction
    last: Fraction
    rate: Fraction
    claimed: Fraction | None

    @property
    def is_gray(self) -> bool:
        """Return whether there is one channel only."""
        return self.pixels.startswith("gray")

    @property
    def is_deep_gray(self) -> bool:
        """Return whether the stream can hold depth: one channel of more than 8 bits."""
        return self.is_gray and self.pixels != "gray"


def is_container(root: Path, name: str) -> bool:
    """Return whether `name` is an existing file that is no picture.

    Any file that is no picture counts as a video. The reader of videos reports one that is neither.
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
    """Open a video file with FFmpeg.

    Raises
    ------
    FormatError
        If it is no video, or of an unsupported format.
    """
    import av

    av.logging.set_level(None)  # errors are reported once, in our own messages
    with open_file(path) as file:
        with ffmpeg_decoding(path, NEITHER):
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
def ffmpeg_decoding(path: Path, complaint: str) -> Iterator[None]:
    """Convert errors like `decoding`, FFmpeg's among them, and keep only their reason."""
    import av

    with decoding(path, complaint):
        try:
            yield
        except av.FFmpegError as error:
            raise FormatError(f"{path}: {complaint} ({error.strerror})") from error


def _refuse(url: str, *_: Any) -> NoReturn:
    raise PermissionError(f"{url}: a video may not name other files")


def video_streams(path: Path) -> list[StreamInfo]:
    """List the video streams of a file, without cover pictures.

    Raises
    ------
    FormatError
        If it is no video, has no video stream, or its pictures are too large.
    """
    with opened(path) as container:
        streams = container.streams.video[:MAX_STREAMS]
        found = []
        for stream in streams:
            context = stream.codec_context
            if "attached_pic" in str(stream.disposition).lower() or context is None:
                continue
            if context.width < 1 or context.height < 1:  # FFmpeg's way to reject a size
                raise FormatError(
                    f"{path}: its header gives pictures no size, or more than {MAX_PIXELS} pixels, "
                    "the most that are read"
                )
            require_picture_size(path, context.width, context.height)
            with ffmpeg_decoding(path, "damaged or cut off video"):
                found.append(_info(path, container, stream))
    if not found:
        raise FormatError(f"{path}: holds no video stream")
    return found


def _info(path: Path, container: InputContainer, stream: Any) -> StreamInfo:
    base = time_base(stream)
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
        transfer=int(stream.codec_context.color_trc),
        start=start,
        last=_last_time(container, stream, start, start + (claimed or 0)),
        rate=rate,
        claimed=claimed,
    )


def _last_time(container: InputContainer, stream: Any, start: Fraction, end: Fraction) -> Fraction:
    """Find the time of the last frame in the file, which may have been cut off.

    Packets are in decoding order, so the last frame is among the last packets.
    """
    import av

    base = time_base(stream)
    with suppress(av.FFmpegError):
        container.seek(int(max(start, end - LAST_S) / base), stream=stream)
    last = start
    with suppress(av.FFmpegError):
        for count, packet in enumerate(container.demux(stream)):
            stamp = stamp_of(packet)
            if stamp is not None:
                last = max(last, stamp * base)
            if count > LONGEST_SEARCH:
                break
    return last


def time_base(stream: Any) -> Fraction:
    """Return the seconds per unit of a stream's time stamps."""
    return Fraction(stream.time_base or Fraction(1, 1_000_000))


def stamp_of(timed: Any) -> int | None:
    """Return a packet's or frame's presentation time, or decoding time in AVI; stream units."""
    stamp: int | None = timed.pts if timed.pts is not None else timed.dts
    return stamp
