"""Progress on stderr: a bar, if this is a terminal, or lines for other programs."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal, Protocol

from iprt.files.progress_line import ProgressLine
from iprt.files.termination import at_termination

ProgressKind = Literal["bar", "lines", "openjd"]

CLEAR = b"\r\x1b[K\x1b[?25h"
"""Escape sequence that removes an unfinished bar: it clears the line and shows the cursor."""


class Update(Protocol):
    """Callback that advances a bar."""

    def __call__(self, done: int, note: str = "", /) -> None:
        """Show `done` frames as finished, and `note` behind the label."""


@contextmanager
def progress_bar(
    label: str,
    frames: int,
    unit: str = "frames",
    *,
    done: int = 0,
    remaining: bool = False,
    kind: ProgressKind = "bar",
) -> Iterator[Update]:
    """Show a bar while the block runs; it yields the callback that advances the bar.

    Nothing is written if stderr is no terminal, where a log would only get empty lines, or if the
    log is quiet.

    Parameters
    ----------
    done : int
        Frames that were finished before.
    remaining : bool
        Show the remaining time and the seconds per frame, too.
    kind : {"bar", "lines", "openjd"}
        In place of a bar, in any case: `lines` writes a `ProgressLine` to stderr for each advance,
        `openjd` a percentage to stdout in the form of Open Job Description.
    """
    if kind == "openjd":
        last = -1

        def tell(done: int, note: str = "") -> None:
            nonlocal last
            if done != last:
                print(f"openjd_progress: {100.0 * done / frames:.1f}", flush=True)
            last = done

        tell(done)
        yield tell
        return
    if kind == "lines":

        def write(done: int, note: str = "") -> None:
            print(ProgressLine(done, frames, note), file=sys.stderr, flush=True)

        write(done)
        yield write
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class SecondsPerFrame(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text("" if not task.speed else f"{1.0 / task.speed:.2g} s/frame")

    console = Console(stderr=True)
    shown = console.is_terminal and logging.getLogger("iprt").isEnabledFor(logging.INFO)
    columns: tuple[ProgressColumn, ...] = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeElapsedColumn(),
    )
    if remaining:
        columns += (TextColumn("left:"), TimeRemainingColumn(), SecondsPerFrame())

    def clear() -> None:
        if shown:
            os.write(2, CLEAR)

    with (
        at_termination(clear),
        Progress(*columns, console=console, transient=True, disable=not shown) as bar,
    ):
        task = bar.add_task(label, total=frames, completed=done)

        def update(done: int, note: str = "") -> None:
            bar.update(task, completed=done, description=f"{label}{note}")

        yield update
