"""A table of texts, for people: in a terminal, as Markdown, or as HTML."""

from __future__ import annotations

import sys
from dataclasses import dataclass

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

WIDTH = 160
"""Columns where the output is no terminal: rich would cut the numbers at 80."""


@dataclass(frozen=True)
class Grid:
    """A table with a heading.

    Attributes
    ----------
    rows : tuple of tuple of str
        One text per column each.
    notes : tuple of str
        What stands below.
    words : int
        Leading columns of words; all others hold numbers and stand to the right.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    words: int = 1

    def table(self) -> Table:
        """For a terminal."""
        table = Table(
            title=Text(self.title),
            title_justify="left",
            caption=Text("\n".join(self.notes)) if self.notes else None,
            caption_justify="left",
            box=SIMPLE_HEAD,
            padding=0,
        )
        for index, column in enumerate(self.columns):
            right = index >= self.words
            table.add_column(Text(column), justify="right" if right else "left", no_wrap=right)
        for row in self.rows:
            table.add_row(*map(Text, row))
        return table

    def markdown(self) -> str:
        """For a page; the title stays away, as pages have headings of their own."""
        marks = ["---" if index < self.words else "---:" for index in range(len(self.columns))]
        lines = [_line(self.columns), _line(marks), *map(_line, self.rows)]
        return "\n".join([*lines, "", *self.notes]).rstrip() + "\n"


def _line(cells: tuple[str, ...] | list[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def print_grid(grid: Grid, *, markdown: bool = False) -> None:
    """Print to stdout, as wide as it needs where that is no terminal."""
    if markdown:
        print(grid.markdown(), end="")
        return
    console = Console() if sys.stdout.isatty() else Console(width=WIDTH)
    console.print(grid.table())
