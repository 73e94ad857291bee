"""Tracks of color, depth and normals that `[video]` names, and their clock.

The video has its own clock: frame i is shown i / fps seconds after the first. It takes the nearest
frame of every stream. Streams of different or variable rates thus stay in sync, and a frame does
not depend on the order of reading.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.images import Header, read_color, read_normal
from iprt.files.safe_reading import is_file, require_inside
from iprt.files.toml_tables import LAST_FRAME
from iprt.footage.video.color import has_highlights, linear_color, luma
from iprt.footage.video.container import StreamInfo, is_container, video_streams
from iprt.footage.video.depth_code import DepthCode, DepthMarks, DepthSamples, unit_problem
from iprt.footage.video.mistaken_depth import gray_at_first
from iprt.footage.video.picture_tracks import DepthPictures, PictureTrack
from iprt.footage.video.pixel_planes import layout
from iprt.footage.video.reader import Streams
from iprt.footage.video.video_table import VideoTable

if TYPE_CHECKING:
    import av

Picture = NDArray[np.float32]
Item = TypeVar("Item")
Shown = TypeVar("Shown", covariant=True)
DEFAULT_FPS = Fraction(30)
SAME_RATE = 2e-4
"""Relative difference up to which rates count as equal; 30 and 30/1.001 differ by 1e-3."""


class Track(Protocol[Shown]):
    """Pictures of one kind along a video: color, depth as stored, or normals."""

    def file(self, index: int) -> Path:
        """Return the file that holds a frame's picture."""

    def missing(self) -> Iterator[Path]:
        """Iterate over missing files, in the order of frames."""
        return iter(())

    def problems(self) -> list[str]:
        """Return reasons why existing files cannot be read; a line with its key each."""
        return []

    def header(self) -> Header:
        """Read the header of the first picture."""

    def reader(self, streams: Streams) -> Callable[[int], Shown]:
        """Return a function that reads the picture of a frame; quickest in order."""


class StreamTrack(Track[Item]):
    """Pictures in some rows of a video stream.

    Parameters
    ----------
    info : StreamInfo
        The stream.
    zero : Fraction
        Time of frame 0, in seconds on the file's clock.
    fps : Fraction
        Frames per second of the video.
    rows : slice
        Rows of the stream's frames.
    decode : callable
        Converts rows of a frame to a picture; takes frame, rows, and the file's name for errors.
    """

    def __init__(
        self,
        info: StreamInfo,
        zero: Fraction,
        fps: Fraction,
        rows: slice,
        decode: Callable[[av.VideoFrame, slice, Path], Item],
    ) -> None:
        self._info, self._zero, self._fps = info, zero, fps
        self._rows, self._decode = rows, decode

    def file(self, _: int) -> Path:
        """Return the video file."""
        return self._info.path

    def moment(self, index: int) -> Fraction:
        """Return the time of a frame, in seconds on the file's clock."""
        return self._zero + index / self._fps

    def header(self) -> Header:
        """Return the size and range of the pictures."""
        info, height = self._info, self._rows.stop - self._rows.start
        return Header(info.width, height, not has_highlights(info.pixels, info.transfer))

    def reader(self, streams: Streams) -> Callable[[int], Item]:
        """Return a function that decodes the picture of a frame."""
        info, stream = self._info, streams(self._info)

        def read(index: int) -> Item:
            frame = stream.at(self.moment(index))
            if (frame.width, frame.height) != (info.width, info.height):
                raise FormatError(
                    f"{info.path}: {frame.width} x {frame.height} pixels in frame {index}, but its "
                    f"header says {info.width} x {info.height}"
                )
            return self._decode(frame, self._rows, info.path)

        return read


@dataclass(frozen=True)
class Tracks:
    """All tracks of a video.

    Attributes
    ----------
    by_key : dict of str to Track
        Tracks by their key in `[video]`.
    indices : range
        Indices of the frames.
    fps : float
        Frames per second.
    disagreements : list of str
        Disagreements between streams, a line each.
    """

    by_key: dict[str, Track[Any]]
    indices: range
    fps: float
    disagreements: list[str]


def open_tracks(root: Path, video: VideoTable, within: Path) -> Tracks:
    """Read the headers of the files that `[video]` names.

    Raises
    ------
    FormatError
        If a video file is unusable, with its key. Pictures are not opened.
    """
    color, others = _color_stream(root, video, within)
    depth = _depth_stream(root, video, within, color, others)
    _require_no_layers(video, color, depth)
    timed = color or depth
    fps = timed.rate if timed else DEFAULT_FPS
    if video.fps is not None:
        fps = Fraction(video.fps).limit_denominator(10**6)
    indices = _indices(video, fps, color)
    first = indices[0] if color is None else 0
    place = root, indices, within
    code = depth_code(video)
    by_key: dict[str, Track[Any]] = {}
    packed = color is not None and depth is color
    if color is None:
        read = partial(read_color, layer=video.color_layer)
        by_key["color"] = PictureTrack("color", video.color, *place, read, video.color_layer)
    else:
        rows = slice(0, color.height // 2 if packed else color.height)
        by_key["color"] = StreamTrack(color, color.start, fps, rows, linear_color)
    if depth is None:
        assert video.depth is not None
        by_key["depth"] = DepthPictures(video.depth, *place, video.depth_layer, code)
    else:
        if not code.is_known:
            raise FormatError(unit_problem(depth.path.name))
        rows = slice(depth.height // 2 if packed else 0, depth.height)
        # Streams of one file share its clock. Another file's clock starts with the video.
        same = color is not None and color.path == depth.path
        zero = color.start if color is not None and same else depth.start
        decode = gray_at_first(_depth_samples) if packed else _depth_samples
        by_key["depth"] = StreamTrack(depth, zero - first / fps, fps, rows, decode)
    if video.normal is not None:
        by_key["normal"] = PictureTrack("normal", video.normal, *place, read_normal)
    length = (indices[-1] - first) / fps
    notes = _disagreements(fps, length, {"color": color, "depth": None if packed else depth})
    return Tracks(by_key, indices, float(fps), notes)


def _require_no_layers(
    video: VideoTable, color: StreamInfo | None, depth: StreamInfo | None
) -> None:
    """Raise FormatError if a layer of a video file is named."""
    named = {"color": (video.color_layer, color), "depth": (video.depth_layer, depth)}
    for key, (layer, stream) in named.items():
        if layer is not None and stream is not None:
            raise FormatError(
                f"video.{key}_layer: {stream.path} is a video file and has no layers; only EXR "
                "files have layers"
            )


def depth_code(video: VideoTable) -> DepthCode:
    """Return the meaning of stored depth."""
    ends = None if video.depth_range is None else (video.depth_range[0], video.depth_range[1])
    given = video.depth_invalid, video.depth_sky
    marks = None
    if any(values is not None for values in given):
        marks = DepthMarks(*(tuple(values or ()) for values in given))
    return DepthCode(video.depth_scale, ends, video.depth_encoding, video.depth_kind, marks)


def _depth_samples(frame: av.VideoFrame, rows: slice, path: Path) -> DepthSamples:
    stored, black, white = luma(frame, rows, path)
    how = layout(frame.format.name)
    assert how is not None
    bits = 0 if how.is_float else how.bits
    return DepthSamples(stored, black, white, bits, exact=how.kind == "gray" and how.bits > 8)


def _indices(video: VideoTable, fps: Fraction, color: StreamInfo | None) -> range:
    if video.frames is not None:
        return range(video.frames[0], video.frames[1] + 1)
    count = 1 if color is None else round((color.last - color.start) * fps) + 1
    if count > LAST_FRAME + 1:
        raise FormatError(
            f"video.frames: {video.color} has {count} frames; say which to use, at most the first "
            f"{LAST_FRAME + 1}"
        )
    return range(count)


def _streams(key: str, root: Path, name: str, within: Path) -> list[StreamInfo]:
    try:
        require_inside(root / name, within)
        return video_streams(root / name)
    except FormatError as error:
        raise FormatError(f"video.{key}: {error}") from error


def _color_stream(
    root: Path, video: VideoTable, within: Path
) -> tuple[StreamInfo | None, list[StreamInfo]]:
    """Return the stream of color, if it comes from a video file, and the file's other streams."""
    if not is_container(root, video.color):
        return None, []
    streams = _streams("color", root, video.color, within)
    color = next((stream for stream in streams if not stream.is_deep_gray), streams[0])
    return color, [stream for stream in streams if stream is not color]


def _depth_stream(
    root: Path,
    video: VideoTable,
    within: Path,
    color: StreamInfo | None,
    others: list[StreamInfo],
) -> StreamInfo | None:
    """Return the stream of depth, if in a video file; the color stream if that holds both."""
    if video.depth is None:
        if color is None and not is_file(root / video.color):
            raise FormatError(f"video.color: there is no file {video.color}")
        if color is None:
            raise FormatError(
                f"video.depth: required key is missing; {video.color} is no video file, which "
                "could hold depth itself; name a file of depth (see docs/footage.md)"
            )
        found = next((stream for stream in others if stream.is_deep_gray), None)
        if found is not None:
            return found
        if video.eye is not None:
            raise FormatError(
                f"video.depth: {color.path} holds no second stream of 16-bit grey; with eye, which "
                "takes one of two pictures in colors, name a file of depth"
            )
        # Two panoramas stacked vertically make a square.
        if color.width == color.height and color.height % 4 == 0:
            return color
        raise FormatError(
            f"video.depth: {color.path} holds no depth: no second stream of 16-bit grey, and its "
            f"{color.width} x {color.height} pixels are not a square with color above depth; name "
            "a file of depth (see docs/footage.md)"
        )
    if not is_container(root, video.depth):
        return None
    streams = _streams("depth", root, video.depth, within)
    depth = next((stream for stream in streams if stream.is_deep_gray), None)
    if depth is None:
        raise FormatError(
            f"video.depth: {root / video.depth} holds {streams[0].pixels}; depth needs a stream of "
            "grey with more than 8 bits, such as FFV1 with gray16le"
        )
    return depth


def _disagreements(
    fps: Fraction, length: Fraction, streams: dict[str, StreamInfo | None]
) -> list[str]:
    """Return lines on disagreements between streams and how they are resolved.

    `length` is the time of the video's last frame in seconds.
    """
    lines = []
    for key, stream in streams.items():
        if stream is None:
            continue
        name, end = f"video.{key}: {stream.path.name}", stream.last - stream.start
        if abs(stream.rate - fps) > SAME_RATE * max(stream.rate, fps):
            lines.append(
                f"{name} has {float(stream.rate):.6g} frames per second, the video "
                f"{float(fps):.6g}; the nearest in time are shown"
            )
        period = 1 / min(stream.rate, fps)
        if length >= end + period:
            lines.append(
                f"{name} ends after {float(end):.2f} s, the video after {float(length):.2f} s; its "
                "last frame stays"
            )
        elif stream.claimed is not None and stream.claimed > end + 2 / stream.rate + period:
            lines.append(
                f"{name} ends after {float(end):.2f} s, but claims {float(stream.claimed):.2f} s; "
                "it may be cut off"
            )
    return lines
