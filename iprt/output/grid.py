"""Tables of text: in a terminal, as Markdown, or as HTML."""

from __future__ import annotations

import sys
from dataclasses import dataclass

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

WIDTH = 160
"""Width where the output is not a terminal: rich would cut the numbers at 80."""


@dataclass(frozen=True)
class Grid:
    """Table with a heading.

    Attributes
    ----------
    rows : tuple of tuple of str
        One text per column each.
    notes : tuple of str
        Lines below the table.
    words : int
        Number of leading columns of words; all others hold numbers and are right-aligned.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    words: int = 1

    def table(self) -> Table:
        """Return the table for a terminal."""
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
        """Return the table as Markdown, without the title: pages have headings of their own."""
        marks = ["---" if index < self.words else "---:" for index in range(len(self.columns))]
        lines = [_line(self.columns), _line(marks), *map(_line, self.rows)]
        return "\n".join([*lines, "", *self.notes]).rstrip() + "\n"


def _line(cells: tuple[str, ...] | list[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def print_grid(grid: Grid, *, markdown: bool = False) -> None:
    """Print to stdout, as wide as needed where that is not a terminal."""
    if markdown:
        print(grid.markdown(), end="")
        return
    console = Console() if sys.stdout.isatty() else Console(width=WIDTH)
    console.print(grid.table())
