"""Continuous reading of videos with unreadable frames."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace

from iprt.errors import FormatError
from iprt.files.message_text import counted
from iprt.footage.prepare.reading import FrameReader, Picture, RawFrame, RawFrames
from iprt.footage.prepare.remarks import depth_doubts, video_remarks

LOG = logging.getLogger("iprt.video")
LOOK_BACK = 300
"""Largest number of frames before the first requested one that are searched for a good one."""


class Incident:
    """A run of bad frames, logged at its beginning and at its end."""

    _bad = 0

    def bad(self, problem: str) -> None:
        """Count a bad frame; `problem` describes it and its replacement."""
        if not self._bad:
            LOG.warning(problem)
        self._bad += 1

    def good(self, index: int) -> None:
        """End the run of bad frames before a good one."""
        if self._bad:
            LOG.warning(f"frame {index}: good again, after {counted(self._bad, 'bad frame')}")
        self._bad = 0

    def end(self) -> None:
        """End the run of bad frames at the last frame."""
        if self._bad:
            LOG.warning(f"bad up to the last frame: {counted(self._bad, 'frame')}")
        self._bad = 0


class SteadyReader:
    """A reader that replaces unreadable parts by those from the last good frame.

    Without depth or normals, the last good depth and normals stay, and color goes on. Without
    color, the whole last good frame stays: new depth would not fit old color.

    Parameters
    ----------
    first : int
        First frame of the video, down to which frames before the requested ones are searched.
    strict : bool
        Whether a bad frame is an error.
    """

    def __init__(self, reader: FrameReader, first: int, *, strict: bool) -> None:
        self._reader, self._first, self._strict = reader, first, strict
        self._incident = Incident()
        self._last: RawFrame | None = None
        self._color_of = self._depth_of = first  # the frames from which `_last` is composed

    def read(self, index: int) -> RawFrame:
        """Read a frame.

        Raises
        ------
        FormatError
            If the frame cannot be read, and `strict` is set or no frame before it can be read.
        """
        try:
            color = self._reader.color(index)
        except FormatError as error:
            last = self._before(index, error)
            self._incident.bad(f"{error}; frame {self._color_of} is shown until one is good")
            return replace(last, index=index)
        try:
            raw = self._reader.completed(index, color)
        except FormatError as error:
            last = self._before(index, error)
            self._incident.bad(f"{error}; depth of frame {self._depth_of} stays until one is good")
            return self._recolored(last, index, color)
        self._incident.good(index)
        return self._keep(raw)

    def end(self) -> None:
        """Report a run of bad frames that is still going on."""
        self._incident.end()

    def _keep(self, raw: RawFrame) -> RawFrame:
        self._last = raw
        self._color_of = self._depth_of = raw.index
        return raw

    def _recolored(self, last: RawFrame, index: int, color: Picture) -> RawFrame:
        """Return the last frame with the color and pose of another."""
        self._last = replace(last, color=color, index=index, pose=self._reader.pose(index))
        self._color_of = index
        return self._last

    def _before(self, index: int, error: FormatError) -> RawFrame:
        """Return the last good frame, if need be from before the first requested one.

        The replacement of a bad frame thus does not depend on where rendering was resumed.
        """
        if self._strict:
            raise error
        if self._last is None:
            self._look_back(index)
        if self._last is None:
            raise error
        return self._last

    def _look_back(self, index: int) -> None:
        """Find the last good color and the last good frame before `index`."""
        newest: tuple[int, Picture] | None = None
        for earlier in range(index - 1, max(self._first, index - LOOK_BACK) - 1, -1):
            with suppress(FormatError):
                color = self._reader.color(earlier)
                newest = newest or (earlier, color)
                self._keep(self._reader.completed(earlier, color))
                break
        if self._last is not None and newest is not None and newest[0] != self._depth_of:
            self._recolored(self._last, *newest)


def steady_frames(
    frames: RawFrames, indices: Iterable[int], *, strict: bool = False
) -> Iterator[RawFrame]:
    """Read frames with `SteadyReader`, one by one; log guesses about the video first."""
    for line in frames.source.tracks.disagreements + depth_doubts(frames):
        LOG.warning(line)
    for line in video_remarks(frames):
        LOG.info(line)
    with frames.reading() as reader:
        steady = SteadyReader(reader, frames.source.indices[0], strict=strict)
        for index in indices:
            yield steady.read(index)
        steady.end()


def bad_frames(frames: RawFrames) -> list[str]:
    """Read all frames, and return a line for each run of bad ones, with its first error."""
    runs: list[tuple[int, int, str]] = []
    with frames.reading() as reader:
        for index in frames.source.indices:
            try:
                reader.read(index)
            except FormatError as error:
                if runs and runs[-1][1] == index - 1:
                    runs[-1] = runs[-1][0], index, runs[-1][2]
                else:
                    runs.append((index, index, str(error)))
    return [
        f"frame {first}: {problem}" if first == last else f"frames {first} to {last}: {problem}"
        for first, last, problem in runs
    ]
