"""Frames that cannot be read, in the middle of a video that must go on."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace

from iprt.errors import FormatError
from iprt.files.wording import counted
from iprt.footage.prepare.reading import FrameReader, Picture, RawFrame, RawFrames
from iprt.footage.prepare.remarks import depth_doubts, video_remarks

LOG = logging.getLogger("iprt.video")
LOOK_BACK = 300
"""Frames before the first one asked for that are searched for a good one."""


class Incident:
    """A run of bad frames: reported when it begins, and when it is over."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._bad = 0

    def bad(self, problem: str) -> None:
        """A frame is bad; `problem` says how, and what is done."""
        if not self._bad:
            self._report(problem)
        self._bad += 1

    def good(self, index: int) -> None:
        """A frame is good."""
        if self._bad:
            self._report(f"frame {index}: good again, after {counted(self._bad, 'bad frame')}")
        self._bad = 0

    def end(self) -> None:
        """There is no further frame."""
        if self._bad:
            self._report(f"bad up to the last frame: {counted(self._bad, 'frame')}")
        self._bad = 0


class SteadyReader:
    """Reads frames; what of them cannot be read is that of the last good frame.

    Where depth (or a normal) cannot be read, the last good depth and normals stay, and colour goes
    on. Where colour cannot be read, all of the last good frame stays: new depth would not fit to
    old colour.

    Parameters
    ----------
    first : int
        The video's first frame: what comes before the frames asked for is searched down to it.
    strict : bool
        Whether a bad frame is an error.
    report : callable
        Takes a line at the beginning and at the end of each run of bad frames.
    """

    def __init__(
        self,
        reader: FrameReader,
        first: int,
        *,
        strict: bool = False,
        report: Callable[[str], None] = LOG.warning,
    ) -> None:
        self._reader, self._first, self._strict = reader, first, strict
        self._incident = Incident(report)
        self._last: RawFrame | None = None
        self._color_of = self._depth_of = first  # the frames that `_last` is made of

    def read(self, index: int) -> RawFrame:
        """Read a frame.

        Raises
        ------
        FormatError
            It cannot be read, and `strict`, or no frame before it can.
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
        """Tell of a run of bad frames that goes on up to here."""
        self._incident.end()

    def _keep(self, raw: RawFrame) -> RawFrame:
        self._last = raw
        self._color_of = self._depth_of = raw.index
        return raw

    def _recolored(self, last: RawFrame, index: int, color: Picture) -> RawFrame:
        """Return the last frame with the colour of another, and from where that was seen."""
        self._last = replace(last, color=color, index=index, pose=self._reader.pose(index))
        self._color_of = index
        return self._last

    def _before(self, index: int, error: FormatError) -> RawFrame:
        """Return the last frame: of those read here, or else of those before the first asked for.

        So what stands in for a bad frame does not depend on where a film was resumed.
        """
        if self._strict:
            raise error
        if self._last is None:
            self._look_back(index)
        if self._last is None:
            raise error
        return self._last

    def _look_back(self, index: int) -> None:
        """Find the last good colour and the last good frame before one."""
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
    """Read frames as `SteadyReader` does, one by one; the log tells of guesses about the video."""
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
    """Read all frames, and return a line for each run of bad ones, with the first one's error."""
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
