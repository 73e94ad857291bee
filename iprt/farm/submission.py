"""Film that is handed to the scheduler of a farm."""

from __future__ import annotations

import shutil
import sysconfig
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from unicodedata import category

from iprt.errors import IprtError
from iprt.files.message_text import printable

TIME_LIMIT, LIMIT_START_S = 3.0, 600.0
"""Factor of a task's estimated time, and seconds for its start, that its limit allows."""

UNPRINTABLE = ("Cc", "Cs", "Zl", "Zp")
"""Categories of line breaks, other control characters, and bytes of names that are not UTF-8."""


@dataclass(frozen=True)
class Submission:
    """Chunks of a film for a farm, and the command that renders them.

    Attributes
    ----------
    output : Path
        The film, absolute.
    words : sequence of str
        Words behind `iprt` that render the film, without `--chunks`.
    numbers : sequence of int
        The chunks that miss frames.
    chunk : int
        Frames of a chunk, with its warm-up.
    gpus : int
        GPUs of a task.
    target_s : float
        Time that a task is meant to take.
    frame_s : float or None
        Time of a frame; None: unknown.
    """

    output: Path
    words: Sequence[str]
    numbers: Sequence[int]
    chunk: int
    gpus: int
    target_s: float
    frame_s: float | None

    @property
    def scene(self) -> str:
        """The scene folder, absolute."""
        return self.words[1]

    @property
    def group(self) -> int:
        """Number of chunks that take about as long as a task is meant to, at least 1."""
        if self.frame_s is None:
            return 1
        wanted = round(self.target_s / (self.chunk * self.frame_s))
        return min(max(wanted, 1), len(self.numbers))

    def limit_s(self, chunks: int) -> float | None:
        """Return the time limit of a task with a number of chunks, in seconds; None: unknown."""
        if self.frame_s is None:
            return None
        return TIME_LIMIT * chunks * self.chunk * self.frame_s + LIMIT_START_S


def require_words(words: Iterable[str]) -> None:
    """Refuse words that a script or a template cannot hold.

    Raises
    ------
    IprtError
        A word has a line break, another control character, or bytes that are not UTF-8.
    """
    for word in words:
        if any(category(character) in UNPRINTABLE for character in word):
            shown = printable(word).encode("utf-8", "backslashreplace").decode()
            raise IprtError(f"{shown}: has characters that a farm's files cannot hold; rename it")


def iprt() -> str:
    """Return the file of the command `iprt` that belongs to this Python, or else its name."""
    return shutil.which("iprt", path=sysconfig.get_path("scripts")) or "iprt"
