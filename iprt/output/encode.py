"""Video encoding: independent pieces, joined without re-encoding."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from heapq import merge
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.atomic import replacing
from iprt.output.boxes import index_first
from iprt.output.display import display
from iprt.output.sound import Sound, ambisonic_box, sound_packets
from iprt.output.ycbcr import ycbcr420

LOG = logging.getLogger("iprt.render")

CodecName = Literal["h264", "hevc"]
FORMATS = {".mp4": "mp4", ".mov": "mov", ".mkv": "matroska"}
"""Suffix -> FFmpeg's name of the container."""
RATES = (Fraction(1, 1000), Fraction(1000))
"""Least and most frames a second that containers store accurately."""
LARGEST_DIVISOR = 1001
"""Largest denominator of a frame rate: 30000/1001 is NTSC."""


@dataclass(frozen=True)
class Codec:
    """Encoder and its options.

    Attributes
    ----------
    encoder : str
        FFmpeg's name.
    pixels : str
        FFmpeg's name of the planes: luma, and two of chroma at half the width and height.
    bits : int
        Bits of a sample.
    options : mapping of str to str
        Options of the encoder: constant quality without visible loss; headers independent of the
        pictures, and no references out of a piece, so that pieces can be joined. The number of
        threads is fixed, and x264 takes the same algorithms everywhere (`cpu-independent`), so
        that every machine writes the same bytes.
    tag : str or None
        Format tag in MP4 and QuickTime files, where players expect another name than FFmpeg's.
    """

    encoder: str
    pixels: str
    bits: int
    options: Mapping[str, str]
    tag: str | None = None


X264 = "stitchable=1:open-gop=0:threads=4:cpu-independent=1"
X265 = "log-level=error:open-gop=0:frame-threads=2"
CODECS: Mapping[CodecName, Codec] = {
    "h264": Codec(
        "libx264",
        "yuv420p",
        8,
        {"crf": "18", "preset": "medium", "x264-params": X264},
    ),
    "hevc": Codec(
        "libx265",
        "yuv420p10le",
        10,
        {"crf": "20", "preset": "medium", "x265-params": X265},
        tag="hvc1",
    ),
}


def require_codec(name: CodecName) -> None:
    """Raise an error now if the codec is not available.

    Raises
    ------
    FormatError
        PyAV was built without the encoder.
    """
    import av

    try:
        av.Codec(CODECS[name].encoder, "w")
    except ValueError as error:
        raise FormatError(
            f"--codec {name}: PyAV {av.__version__} has no {CODECS[name].encoder}; "
            "pip install 'av>=14', whose wheels have it"
        ) from error


def frame_rate(fps: float, step: int = 1) -> Fraction:
    """Return the rate of every `step`-th frame of a video, in frames a second.

    Raises
    ------
    FormatError
        Containers cannot store it.
    """
    rate = Fraction(fps).limit_denominator(LARGEST_DIVISOR) / step
    if not RATES[0] <= rate <= RATES[1]:
        raise FormatError(
            f"{fps / step:g} frames a second: video files hold {float(RATES[0]):g} to "
            f"{float(RATES[1]):g}; change video.fps, or write pictures"
        )
    return rate


def require_even(width: int, height: int) -> None:
    """Raise an error for odd sizes: chroma planes have half the width and height.

    Raises
    ------
    FormatError
    """
    if width % 2 or height % 2:
        even = f"{max(width - width % 2, 2)} {max(height - height % 2, 2)}"
        raise FormatError(f"{width} x {height} pixels: video needs even sides; try --size {even}")


def planes(color: NDArray[np.float32], exposure: float, codec: CodecName) -> NDArray[Any]:
    """Return the encoder's input: `ycbcr420` of the displayed picture.

    Parameters
    ----------
    color : (H, W, 3) float32
        Linear radiance; H and W even.

    Raises
    ------
    FormatError
        The radiance is not finite.
    """
    return ycbcr420(display(color, exposure), CODECS[codec].bits)


def encode_piece(
    path: Path, pictures: Iterable[NDArray[Any]], *, codec: CodecName, rate: Fraction
) -> None:
    """Write a piece of video, atomically: an independent MP4 file of at least one picture.

    Parameters
    ----------
    pictures : iterable of `planes`

    Raises
    ------
    FormatError
        It cannot be written.
    """
    import av

    with (
        replacing(path) as temporary,
        _reported(path),
        av.open(_address(temporary), "w", format="mp4") as container,
    ):
        stream = None
        packets: list[Any] = []
        for number, picture in enumerate(pictures):
            if stream is None:
                stream = _stream(container, picture, codec, rate)
            frame = av.VideoFrame.from_ndarray(picture, format=CODECS[codec].pixels)
            frame.pts, frame.time_base = number, 1 / rate
            packets += stream.encode(frame)
        assert stream is not None, "a piece of no pictures"
        mux_in_order(container, packets + stream.encode())


def mux_in_order(container: Any, packets: list[Any]) -> None:
    """Write packets with presentation times 0, 1, 2, ... and decoding times that fit them.

    x265 leaves the decoding time of the shortest films undefined.
    """
    ahead = max(number - packet.pts for number, packet in enumerate(packets))
    for number, packet in enumerate(packets):
        packet.dts = number - ahead
        container.mux(packet)


def _stream(container: Any, picture: NDArray[Any], name: CodecName, rate: Fraction) -> Any:
    from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc

    codec = CODECS[name]
    stream = container.add_stream(codec.encoder, rate=rate, options=dict(codec.options))
    stream.height, stream.width = picture.shape[0] * 2 // 3, picture.shape[1]
    stream.pix_fmt = codec.pixels
    context = stream.codec_context
    context.time_base = 1 / rate
    context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG
    # Values use the transfer curve of computer displays, which differs from BT.709's.
    context.color_primaries, context.color_trc = ColorPrimaries.BT709, ColorTrc.IEC61966_2_1
    if codec.tag is not None:
        context.codec_tag = codec.tag
    return stream


def join_pieces(
    path: Path,
    pieces: Sequence[tuple[int, Path]],
    *,
    rate: Fraction,
    comment: str,
    additions: Mapping[bytes, bytes] | None = None,
    sound: Sound | None = None,
) -> None:
    """Join pieces into one file without re-encoding pictures; its index comes first.

    Sound that cannot be kept is left out, with a warning.

    Parameters
    ----------
    path : Path
        Its suffix chooses the container. A temporary second file is written beside it.
    pieces : sequence of (int, Path)
        Number of the first picture, and file, in order.
    comment : str
        Text to keep in the file.
    additions : mapping of bytes to bytes
        Boxes of the pictures' track, see `Additions`; for MP4 and QuickTime files.
    sound : Sound or None
        None: the film is silent.

    Raises
    ------
    FormatError
        A piece is damaged, or the file cannot be written.
    """
    import av

    kind = FORMATS[path.suffix.lower()]
    joined = path.with_name(f"index-last{path.suffix}")

    def write(kept: Sound | None) -> None:
        with av.open(_address(joined), "w", format=kind) as container:
            container.metadata["comment"] = comment
            tracks = [_picture_packets(container, pieces, rate)]
            if kept is not None:
                tracks.append(sound_packets(container, kind, kept))
            # All first packets are produced, and with them the streams, before one is written.
            for packet in merge(*tracks, key=lambda packet: packet.dts * packet.time_base):
                container.mux(packet)

    try:
        with _reported(path):
            try:
                write(sound)
            # A full disk is another error, and does not drop the sound.
            except (FormatError, av.error.ArgumentError, av.error.InvalidDataError) as error:
                write(None)  # fails too if pictures are the cause
                assert sound is not None
                reason = str(error)
                if not isinstance(error, FormatError):
                    reason = f"{sound.path}: its sound cannot be kept ({error.strerror})"
                LOG.warning("%s; the film is written without sound", reason)
                sound = None
        if kind == "matroska":
            joined.replace(path)
        else:
            around = {} if sound is None else {b"stsd": ambisonic_box(sound)}
            index_first(joined, path, {b"vide": additions or {}, b"soun": around})
    except OSError as error:
        raise FormatError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        joined.unlink(missing_ok=True)


def _picture_packets(
    container: Any, pieces: Sequence[tuple[int, Path]], rate: Fraction
) -> Iterator[Any]:
    """Add a stream of pictures to an open output file, and yield its packets in order."""
    import av

    decoded_at = -max(_decoded_ahead(piece) for _, piece in pieces)
    stream = headers = None
    for first, piece in pieces:
        with av.open(_address(piece)) as part:
            source = part.streams.video[0]
            if stream is None:
                stream = container.add_stream_from_template(source)
                stream.codec_context.codec_tag = source.codec_context.codec_tag
                headers = source.codec_context.extradata
            elif source.codec_context.extradata != headers:
                raise FormatError(f"{piece}: is of another encoder than {pieces[0][1].name}")
            for packet in part.demux(source):
                if packet.pts is None:  # the last one, which is empty
                    continue
                frame = round(1 / rate / packet.time_base)
                # Pieces differ in the delay between decoding and display.
                packet.pts, packet.dts = packet.pts + first * frame, decoded_at * frame
                decoded_at += 1
                packet.stream = stream
                yield packet


def _decoded_ahead(piece: Path) -> int:
    """Return the number of pictures by which a piece is decoded before display."""
    import av

    with av.open(_address(piece)) as part:
        packet = next(part.demux(video=0))
        return 0 if packet.dts is None else round(-packet.dts / (packet.duration or 1))


def read_comment(path: Path) -> str | None:
    """Return the comment that `join_pieces` wrote; None if there is no such file."""
    import av

    try:
        with av.open(_address(path)) as container:
            return next((v for k, v in container.metadata.items() if k.lower() == "comment"), None)
    except (av.FFmpegError, OSError):
        return None


def _address(path: Path) -> str:
    """Return the file's name for FFmpeg, which takes the start of `12:30/a.mp4` for a protocol."""
    return os.path.abspath(path)


@contextmanager
def _reported(path: Path) -> Iterator[None]:
    """Convert FFmpeg's errors into errors of the system or of the package."""
    import av

    try:
        yield
    except av.FFmpegError as error:
        raise FormatError(f"{path}: cannot be written: {error.strerror}") from error
