"""Remarks on a video, one line each: reasons why it is unreadable, bridged gaps, and guesses."""

from __future__ import annotations

from iprt.errors import FormatError
from iprt.files.message_text import extent
from iprt.footage.prepare.reading import RawFrames
from iprt.footage.video.source import FrameSource


def video_problems(source: FrameSource, *, strict: bool = False) -> list[str]:
    """Return reasons why a video cannot be read.

    These are a missing file of the first frame, links that leave the folder, and depth without a
    unit. If `strict`, any missing file is one.
    """
    try:
        tracks = source.tracks.by_key
    except FormatError as error:
        return [str(error)]
    lines, gaps = [], _gaps(source)
    for key, track in tracks.items():
        first = key in gaps and source.missing[key][0] == track.file(source.indices[0])
        if key in gaps and (first or strict):
            lines.append(f"video.{key}: {gaps[key]}")
        else:
            lines += track.problems()
    try:
        source.pose(source.indices[0])
    except FormatError as error:
        lines += [f"video.poses: {line}" for line in error.lines]
    return lines


def video_notices(source: FrameSource) -> list[str]:
    """Return gaps that the reader of a video fills, and disagreements between its streams."""
    gaps = [f"video.{key}: {line}; the one before it stays" for key, line in _gaps(source).items()]
    return gaps + source.tracks.disagreements


def _gaps(source: FrameSource) -> dict[str, str]:
    """Return a line about missing files by key."""
    lines = {}
    for key, files in source.missing.items():
        least = "at least " if len(files) == source.MAX_MISSING else ""
        more = f" (and {least}{len(files) - 1} more frames)" if len(files) > 1 else ""
        lines[key] = f"there is no file {files[0].relative_to(source.root)}{more}"
    return lines


def video_remarks(frames: RawFrames) -> list[str]:
    """Return remarks on unread parts of color, its coverage of the sphere, and depth."""
    source = frames.source
    path, placement = source.files(source.indices[0])["color"], source.placement
    lines = []
    if source.header.unread:
        lines.append(f"video.color: {path.name} {source.header.unread}")
    if placement is not None and placement.known < 0.99999:
        lines.append(
            f"video.color: {path.name} covers {100 * placement.known:.3g}% of the sphere; the "
            "rest is unknown: black, without a surface, and gives no light"
        )
    return lines + interpolation(frames)


def interpolation(frames: RawFrames) -> list[str]:
    """Return at most one line: depth has a lower resolution than color, and is interpolated."""
    source, stored = frames.source, frames.stored_depth
    if stored is None or (stored.grid is None and stored.size == source.size):
        return []
    name = source.files(source.indices[0])["depth"].name
    what = f"video.depth: {name} has {extent(stored.size)} pixels"
    if stored.grid is not None:
        what += f", enlarged from {extent(stored.grid.size)} by repeating them"
    if stored.size != source.size:
        what += f"; color has {extent(source.size)}"
    return [f"{what}; depth is interpolated along surfaces"]


def depth_doubts(frames: RawFrames) -> list[str]:
    """Return guesses and doubts about stored depth."""
    return [] if frames.stored_depth is None else list(frames.stored_depth.doubts)
