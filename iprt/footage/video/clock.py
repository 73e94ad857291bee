"""Mapping between frames of a video and times in its streams.

The video has its own clock: frame i is shown i / fps seconds after the first. It takes the nearest
frame of every stream. Streams of different or variable rates thus stay in sync, and a frame does
not depend on the order of reading.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from iprt.footage.video.container import StreamInfo

SAME_RATE = 2e-4
"""Relative difference up to which rates count as equal; 30 and 30/1.001 differ by 1e-3."""


@dataclass(frozen=True)
class Clock:
    """Clock of a video.

    Attributes
    ----------
    fps : Fraction
        Frames per second.
    first : int
        Index of the frame at second 0.
    """

    fps: Fraction
    first: int

    def time(self, index: int) -> Fraction:
        """Return the time of a frame, in seconds from the beginning of the streams."""
        return (index - self.first) / self.fps


def frame_count(stream: StreamInfo, fps: Fraction) -> int:
    """Return the number of frames of a video that shows a whole stream."""
    return round((stream.last - stream.start) * fps) + 1


def disagreements(
    clock: Clock, indices: range, color: StreamInfo | None, depth: StreamInfo | None
) -> list[str]:
    """Return lines on disagreements between streams and how they are resolved."""
    lines = []
    for key, stream in (("color", color), ("depth", depth)):
        if stream is None:
            continue
        name, end = stream.path.name, stream.last - stream.start
        if abs(stream.rate - clock.fps) > SAME_RATE * max(stream.rate, clock.fps):
            lines.append(
                f"video.{key}: {name} has {float(stream.rate):.6g} frames per second, the video "
                f"{float(clock.fps):.6g}; the nearest in time are shown"
            )
        period = 1 / min(stream.rate, clock.fps)
        if clock.time(indices[-1]) >= end + period:
            lines.append(
                f"video.{key}: {name} ends after {float(end):.2f} s, the video after "
                f"{float(clock.time(indices[-1])):.2f} s; its last frame stays"
            )
        elif stream.claimed is not None and stream.claimed > end + 2 / stream.rate + period:
            lines.append(
                f"video.{key}: {name} ends after {float(end):.2f} s, but claims "
                f"{float(stream.claimed):.2f} s; it may be cut off"
            )
    return lines
