"""One small defect, and the tests that must fail with it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Mutant:
    """A piece of a file's text, what a defect makes of it, and the tests that guard it.

    `start` is where the piece begins in the file, -1 for a piece that occurs only once.
    `equivalent`: why no test can tell the mutant from the program; empty where one must.
    """

    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    start: int = -1
    equivalent: str = ""

    def applied(self, text: str) -> str:
        """The file's text with the defect; ValueError where the piece is not there just once."""
        start = self.start
        if start < 0:
            if text.count(self.old) != 1:
                raise ValueError(f"{self.file}: {text.count(self.old)} times: {self.old}")
            start = text.index(self.old)
        end = start + len(self.old)
        if text[start:end] != self.old:
            raise ValueError(f"{self.file}: not at {start}: {self.old}")
        return text[:start] + self.new + text[end:]

    def label(self, text: str) -> str:
        """File, and its line before and after: a name that stays when lines are added elsewhere."""
        start = text.index(self.old) if self.start < 0 else self.start
        line = text.count("\n", 0, start)
        before = text.splitlines()[line].strip()
        after = self.applied(text).splitlines()[line].strip()
        return f"{self.file}: {before} -> {after}"


def read(root: Path, mutant: Mutant) -> str:
    """Text of the mutant's file in a checkout."""
    return (root / mutant.file).read_text(encoding="utf-8")
