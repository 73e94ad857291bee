"""Frames that cannot be read, in the middle of a video that must go on."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from iprt.errors import FormatError
from iprt.files.wording import counted
from iprt.footage.depth import find_openings, sanitise_color
from iprt.footage.frame import Frame
from iprt.footage.video.source import FrameReader, FrameSource, Picture, RawFrame

LOG = logging.getLogger("iprt.video")
LOOK_BACK = 300
"""Frames before the first one asked for that are searched for a good one."""


Stored = tuple[Picture | None, Picture | None]
Stage = Callable[[Frame], Frame]
"""A function from sanitised frames to frames."""


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
    """Reads and sanitises frames; what of them cannot be read is that of the last good frame.

    Where depth (or a normal) cannot be read, the last good depth, openings and normals stay, and
    colour goes on. Where colour cannot be read, all of the last good frame stays: new depth would
    not fit to old colour.

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
        self._last: Frame | None = None
        self._stored: Stored = None, None  # what depth and normals of `_last` were made of
        self._color_of = self._depth_of = first  # the frames that `_last` is made of

    def read(self, index: int) -> Frame:
        """A frame, sanitised.

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
            self._before(index, error)
            self._incident.bad(f"{error}; depth of frame {self._depth_of} stays until one is good")
            return self._recolored(index, color)
        self._incident.good(index)
        return self._keep(raw)

    def end(self) -> None:
        """Tell of a run of bad frames that goes on up to here."""
        self._incident.end()

    def _keep(self, raw: RawFrame) -> Frame:
        self._last = self._unmoved(raw) or raw.sanitised()
        self._stored = raw.depth, raw.normal
        self._color_of = self._depth_of = raw.index
        return self._last

    def _unmoved(self, raw: RawFrame) -> Frame | None:
        """A frame whose depth is that of the one before, which need not be filled and fitted anew.

        As of a static scene with one picture of depth, or of depth with half the rate of colour.
        """
        if self._last is None or not _same((raw.depth, raw.normal), self._stored):
            return None
        color = sanitise_color(raw.color)
        if not np.array_equal(find_openings(raw.depth, color), self._last.opening):
            return None
        return replace(self._last, color=color, index=raw.index, pose=raw.pose)

    def _recolored(self, index: int, color: Picture) -> Frame:
        """The last frame with the colour of another, and from where that was seen."""
        assert self._last is not None
        pose = self._reader.pose(index)
        self._last = replace(self._last, color=sanitise_color(color), index=index, pose=pose)
        self._color_of = index
        return self._last

    def _before(self, index: int, error: FormatError) -> Frame:
        """The last frame: of those read here, or else what came before the first one asked for.

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
            self._recolored(*newest)


def _same(stored: Stored, others: Stored) -> bool:
    """Whether depths and normals are equal, bit for bit."""
    return all(
        other is not None and np.array_equal(plane.view(np.uint32), other.view(np.uint32))
        if plane is not None
        else other is None
        for plane, other in zip(stored, others, strict=True)
    )


def steady_frames(
    source: FrameSource, indices: Iterable[int], stages: Iterable[Stage], *, strict: bool
) -> Iterator[Frame]:
    """Frames as `SteadyReader` reads them, each after all stages."""
    stages = tuple(stages)
    for line in source.disagreements() + source.doubts():
        LOG.warning(line)
    for line in source.remarks():
        LOG.info(line)
    with source.reading() as reader:
        steady = SteadyReader(reader, source.indices[0], strict=strict)
        for index in indices:
            frame = steady.read(index)
            for stage in stages:
                frame = stage(frame)
            yield frame
            del frame  # must not live on while the next one is made
        steady.end()


def bad_frames(source: FrameSource) -> list[str]:
    """Read all frames; a line for each run of bad ones, with the first one's error."""
    runs: list[tuple[int, int, str]] = []
    with source.reading() as reader:
        for index in source.indices:
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
