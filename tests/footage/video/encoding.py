"""Small video files for tests, encoded by PyAV."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

QUIET = {
    "libx265": {"x265-params": "log-level=none"},
    "libsvtav1": {"svtav1-params": "lp=1"},
}
SHARP = {"libx264": {"qp": "1"}, "libx265": {"x265-params": "log-level=none:qp=1"}}


@dataclass(frozen=True)
class Track:
    """A stream to encode.

    Attributes
    ----------
    codec, pixels : str
        FFmpeg's names of encoder and pixel format.
    pictures : sequence of list of arrays
        For each frame, its planes as the format stores them, without padding.
    rate : Fraction or int
        Frames per second.
    times : sequence of int or None
        Times of the frames, in units of 1 / rate; by default one after the other.
    options : dict
        Options of the encoder.
    tags : dict
        Attributes of the codec context: color_range, colorspace, color_trc, color_primaries.
    """

    codec: str
    pixels: str
    pictures: Sequence[list[NDArray[Any]]]
    rate: Fraction | int = 30
    times: Sequence[int] | None = None
    options: dict[str, str] = field(default_factory=dict)
    tags: dict[str, int] = field(default_factory=dict)


@contextmanager
def same_priority() -> Iterator[None]:
    """Undo what SVT-AV1 does to a process of root: real-time priority, which starves all others."""
    if not hasattr(os, "sched_getscheduler"):  # Linux only
        yield
        return
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, parameters)


def write_video(path: Path, *tracks: Track) -> Path:
    """A file with these streams, interleaved by time."""
    with same_priority(), av.open(str(path), "w") as container:
        streams = []
        for track in tracks:
            stream = container.add_stream(track.codec, rate=track.rate)
            stream.options = QUIET.get(track.codec, {}) | track.options
            height, width = track.pictures[0][0].shape[:2]
            stream.width, stream.height, stream.pix_fmt = width, height, track.pixels
            for name, value in track.tags.items():
                setattr(stream.codec_context, name, value)
            streams.append(stream)
        work = [
            (Fraction(track.times[i] if track.times else i) / track.rate, number, i)
            for number, track in enumerate(tracks)
            for i in range(len(track.pictures))
        ]
        for _, number, i in sorted(work):
            track = tracks[number]
            frame = video_frame(track.pixels, track.pictures[i], track.tags)
            frame.pts = track.times[i] if track.times else i
            frame.time_base = 1 / Fraction(track.rate)
            container.mux(streams[number].encode(frame))
        for stream in streams:
            container.mux(stream.encode(None))
    return path


def video_frame(
    pixels: str,
    planes: list[NDArray[Any]],
    tags: dict[str, int] | None = None,
    size: tuple[int, int] | None = None,
) -> av.VideoFrame:
    """A frame of these planes; its height and width are those of the first by default."""
    height, width = size or planes[0].shape[:2]
    frame = av.VideoFrame(width, height, pixels)
    for plane, samples in zip(frame.planes, planes, strict=True):
        rows = np.zeros((plane.height, plane.line_size), np.uint8)
        data = np.ascontiguousarray(samples).reshape(plane.height, -1).view(np.uint8)
        rows[:, : data.shape[1]] = data
        plane.update(rows.tobytes())
    for name, value in (tags or {}).items():
        setattr(frame, name, value)
    return frame


def grey16(codes: Sequence[NDArray[np.integer]], **options: Any) -> Track:
    """A lossless stream of 16-bit grey."""
    return Track("ffv1", "gray16le", [[plane.astype("<u2")] for plane in codes], **options)


def plain(value: int, width: int, height: int) -> list[NDArray[np.uint8]]:
    """Planes of yuv420p: grey of one luma."""
    chroma = np.full((height // 2, width // 2), 128, np.uint8)
    return [np.full((height, width), value, np.uint8), chroma, chroma]
