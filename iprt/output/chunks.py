"""Chunks of a film: where it is cut, so that any machine can render any part.

A chunk begins with a warm-up, which builds the histories of its first frame. It renders the last
frames of the chunk before. Over the second half of them, the film fades from one chunk to the next,
so that no history ends at a seam. A frame depends on its chunk and, in a fade, on the next one's
warm-up. It does not depend on the range of frames that is rendered, nor on who renders it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from iprt.errors import IprtError

LENGTH = 120
"""Default number of frames of a chunk; docs/farm.md has the price and the gain."""
WARM_UP, WARM_UP_STEPS = 8, 16
"""Least numbers of frames and of view frames of a warm-up. After these, a picture differs from one
of an uninterrupted render by noise alone (docs/farm.md)."""


@dataclass(frozen=True)
class Chunks:
    """Division of a video into chunks, and the frames of them that a film shows.

    Chunk `k` has the frames from `k * length` to `(k + 1) * length - 1`, counted in steps of
    `frames` from the lowest number that these reach.

    Parameters
    ----------
    there : range
        Numbers of the video's frames.
    frames : range
        Numbers of the frames of the film.
    length : int
        Frames of a chunk.
    warm_up : int
        Frames of a warm-up, at most `length`.

    Raises
    ------
    IprtError
        A chunk is shorter than a warm-up.
    """

    there: range
    frames: range
    length: int
    warm_up: int

    def __post_init__(self) -> None:
        if self.length < self.warm_up:
            raise IprtError(
                f"--chunk {self.length}: expected at least {self.warm_up}, the frames of a warm-up"
            )

    @cached_property
    def numbers(self) -> range:
        """Numbers of the chunks to render; the last may be needed for its warm-up alone."""
        last = self._position(self.frames[-1]) // self.length
        following = int(self.frames[-1] in self.tail(last))
        return range(self._position(self.frames[0]) // self.length, last + following + 1)

    def frames_of(self, chunk: int) -> range:
        """Return the frames of a chunk that the video has."""
        return self._frames(chunk * self.length, (chunk + 1) * self.length)

    def tail(self, chunk: int) -> range:
        """Return the last frames of a chunk, which fade into the next; empty for the last one."""
        end = (chunk + 1) * self.length
        return self._frames(end - self._fade, end if end in self._there else 0)

    def lead(self, chunk: int) -> range:
        """Return the frames of a chunk's warm-up over which the previous chunk fades into it."""
        return self.tail(chunk - 1)

    def share(self, index: int) -> float:
        """Return the next chunk's share in a frame of a fade, above 0 and below 1."""
        place = self._position(index) % self.length - (self.length - self._fade)
        return (place + 1) / (self._fade + 1)

    @property
    def _fade(self) -> int:
        return fade(self.warm_up)

    @cached_property
    def _there(self) -> range:
        """Positions of the video's frames."""
        first, last = self.there[0], self.there[-1]
        return range(
            -(-(first - self._phase) // self._step), (last - self._phase) // self._step + 1
        )

    @property
    def _step(self) -> int:
        return self.frames.step

    @property
    def _phase(self) -> int:
        return self.frames[0] % self._step

    def _position(self, index: int) -> int:
        return index // self._step

    def _frames(self, begin: int, end: int) -> range:
        """Return the numbers of the frames at positions from `begin` to before `end`."""
        begin, end = max(begin, self._there.start), min(end, self._there.stop)
        return range(self._phase + begin * self._step, self._phase + end * self._step, self._step)


def warm_up(accumulate: int) -> int:
    """Return the frames of a warm-up, with `accumulate` view frames for each frame of the video."""
    return max(WARM_UP, -(-WARM_UP_STEPS // accumulate))


def fade(warm_up: int) -> int:
    """Return the frames of a fade: in the first half of a warm-up, histories are too short."""
    return max(warm_up // 2, 1)


def chunk_numbers(text: str, there: range) -> tuple[int, ...]:
    """Parse the value of `--chunks`, such as `3`, `0-7` or `0-3,8`, to sorted numbers.

    Raises
    ------
    IprtError
        The text has another form, or the film has no such chunks.
    """
    found: set[int] = set()
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        ends = (first, last if dash else first)
        if not all(end.isascii() and end.isdigit() and len(end) < 10 for end in ends):
            raise IprtError(f"--chunks {text}: expected numbers and ranges, such as 0-3,8")
        span = range(int(ends[0]), int(ends[1]) + 1)
        if not span:
            raise IprtError(f"--chunks {text}: {part.strip()} is empty; the lower number is first")
        for number in (span[0], span[-1]):
            if number not in there:
                raise IprtError(
                    f"--chunks {text}: there is no chunk {number}; the film has {there[0]} to "
                    f"{there[-1]}"
                )
        found.update(span)
    return tuple(sorted(found))


def chunk_ranges(numbers: tuple[int, ...]) -> str:
    """Return sorted numbers as the shortest text that `chunk_numbers` takes."""
    runs: list[tuple[int, int]] = []
    for number in numbers:
        if runs and runs[-1][1] == number - 1:
            runs[-1] = runs[-1][0], number
        else:
            runs.append((number, number))
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in runs)
