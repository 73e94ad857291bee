"""Which moment of its streams a frame of the video shows.

The video has a clock of its own: frame i is shown i / fps seconds after the first, and takes of
every stream the frame nearest to that moment. So streams of differing and of variable rates stay
together, and a frame is the same however it is come by.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from iprt.footage.video.container import StreamInfo

SAME_RATE = 2e-4
"""Relative difference of rates that are taken for the same; 30 and 30/1.001 differ by 1e-3."""


@dataclass(frozen=True)
class Clock:
    """When frames are shown.

    Attributes
    ----------
    fps : Fraction
        Frames per second.
    first : int
        Number of the frame at second 0.
    """

    fps: Fraction
    first: int

    def time(self, index: int) -> Fraction:
        """Seconds from the beginning of the streams."""
        return (index - self.first) / self.fps


def frame_count(stream: StreamInfo, fps: Fraction) -> int:
    """Frames of a video that shows all of a stream."""
    return round((stream.last - stream.start) * fps) + 1


def disagreements(
    clock: Clock, indices: range, color: StreamInfo | None, depth: StreamInfo | None
) -> list[str]:
    """Disagreements of the streams, and how they are resolved; one line each."""
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
