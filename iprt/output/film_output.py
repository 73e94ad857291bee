"""Output of a film, whose chunks are rendered in any order by any number of processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from iprt.output.film_plan import FilmPlan
from iprt.output.frames import FrameOutput, Metadata, PictureSequence, is_pattern
from iprt.output.movie import Movie
from iprt.output.parts import Parts
from iprt.output.seams import Seams, Side
from iprt.renderer import RenderedFrame


class FilmOutput:
    """Chunks of a film as files; what exists is kept.

    Parameters
    ----------
    output : Path
        Video file, or pattern of numbered pictures.
    plan : FilmPlan
    numbers : sequence of int
        The chunks to render; others may be rendered elsewhere at the same time.
    expected : callable or None
        Returns metadata of a frame by its number; None: the plan's.

    Attributes
    ----------
    parts : Parts
    total : int
        Number of the film's frames in the chunks.
    done : int
        Number of these frames that are rendered; some may wait for the other side of a fade.

    Raises
    ------
    FormatError
        Parts of a different film exist, or frames of one are in the way.
    """

    def __init__(
        self,
        output: Path,
        plan: FilmPlan,
        numbers: Sequence[int],
        expected: Callable[[int], Metadata] | None = None,
    ) -> None:
        self._plan, self._chunks, self.numbers = plan, plan.chunks, numbers
        self.parts = Parts(output)
        self._expected = expected or (lambda _: plan.identity)
        self._target = self._opened(output)
        self._seams = Seams(self.parts.path, half=output.suffix.lower() != ".exr")
        # Frames in the way of a film are found before the folder of parts is created.
        self._missing = {number: self._absent(number) for number in numbers}
        self.total = sum(len(self._own(number)) for number in numbers)
        waiting = sum(i in self._own(n) for n, missing in self._missing.items() for i in missing)
        self.done = self.total - waiting
        if not self.complete or self.parts.path.exists():
            self.parts.open(plan)

    def _opened(self, output: Path) -> FrameOutput:
        if is_pattern(output):
            return PictureSequence(output, self._expected, self._plan.exposure)
        return Movie(output, self._plan, self.parts)

    @property
    def complete(self) -> bool:
        """True if no frame of the chunks is missing."""
        return not any(self._missing.values())

    def missing(self, number: int) -> Sequence[int]:
        """Return the frames to render of a chunk and its warm-up, in order."""
        return tuple(self._missing[number])

    def write(self, number: int, index: int, picture: RenderedFrame, device: str) -> None:
        """Keep a frame that a chunk has rendered on the device of that name.

        Raises
        ------
        FormatError
            It cannot be written.
        """
        metadata = {**self._expected(index), "iprt:device": device}
        side = self._side(number, index)
        if side is None:
            self._target.write(index, picture, metadata)
        else:
            self._seams.keep(side, index, picture, metadata)
        self._missing[number].remove(index)
        self.done += index in self._own(number)

    def fade(self, number: int) -> None:
        """Write the frames of the fades into and out of a chunk, where both sides are there.

        Another process may do the same, with the same result.

        Raises
        ------
        FormatError
            A side is damaged, or a frame cannot be written.
        """
        for index in (*self._chunks.lead(number), *self._chunks.tail(number)):
            blended = self._seams.blended(index, self._chunks.share(index))
            if blended is not None:
                self._target.write(index, *blended)
                self._seams.drop(index)

    def clean(self) -> None:
        """Remove what killed processes left. No other process may render this film."""
        self.parts.clean()
        self._target.clean()

    def finish(self) -> None:
        """Complete the film, once all chunks are, and remove the parts.

        Raises
        ------
        FormatError
            A part is damaged, or the film cannot be written.
        """
        for number in self.numbers:
            self.fade(number)
        self._target.finish()
        self.parts.remove()

    def _own(self, number: int) -> range:
        """Return the film's frames in a chunk."""
        return _common(self._chunks.frames_of(number), self._plan.frames)

    def _absent(self, number: int) -> list[int]:
        """Return the frames to render of a chunk and its warm-up."""
        lead = _common(self._chunks.lead(number), self._plan.frames)
        return [i for i in (*lead, *self._own(number)) if not self._has(number, i)]

    def _has(self, number: int, index: int) -> bool:
        side = self._side(number, index)
        there = side is not None and self._seams.has(side, index)
        return there or self._target.has(index)

    def _side(self, number: int, index: int) -> Side | None:
        """Return the side of a fade that a chunk renders for a frame; None outside of fades."""
        if index in self._chunks.lead(number):
            return "lead"
        return "tail" if index in self._chunks.tail(number) else None


def _common(frames: range, shown: range) -> range:
    """Return the frames of a chunk that a film shows; both have the same step and phase."""
    return range(max(frames.start, shown.start), min(frames.stop, shown[-1] + 1), shown.step)
