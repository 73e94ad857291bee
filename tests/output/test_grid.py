"""Tables say the same in a terminal and as Markdown."""

from __future__ import annotations

import io

from rich.console import Console

from iprt.output.grid import Grid

GRID = Grid("a [b]title", ("name", "[i]ms"), (("a|b", "1.0"), ("[red]c", "22.0")), ("a [b]note",))


def test_terminal_shows_texts_as_they_are() -> None:
    stream = io.StringIO()
    Console(file=stream, width=40).print(GRID.table())
    lines = [line.split() for line in stream.getvalue().splitlines()]
    assert ["a|b", "1.0"] in lines
    assert ["[red]c", "22.0"] in lines
    assert ["name", "[i]ms"] in lines
    assert ["a", "[b]title"] in lines
    assert ["a", "[b]note"] in lines


def test_markdown_is_a_table() -> None:
    assert GRID.markdown().splitlines() == [
        "| name | [i]ms |",
        "| --- | ---: |",
        "| a\\|b | 1.0 |",
        "| [red]c | 22.0 |",
        "",
        "a [b]note",
    ]
