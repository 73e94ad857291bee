"""Progress of a film that a cluster renders: a bar, a table of workers, or lines for programs."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING

from iprt.commands.progress import CLEAR, ProgressKind
from iprt.files.progress_line import ProgressLine
from iprt.files.termination import at_termination

if TYPE_CHECKING:
    from rich.table import Table

    from iprt.farm.crew import Worker

MOST_ROWS = 12
"""Most workers that the table shows."""

Show = Callable[[int, Sequence["Worker"]], None]
"""Shows finished frames, and the workers."""


@contextmanager
def cluster_progress(total: int, done: int, kind: ProgressKind) -> Iterator[Show]:
    """Show the progress while the block runs; it yields the callback that advances it.

    Parameters
    ----------
    total : int
        Frames of the film.
    done : int
        Frames that were finished before.
    kind : {"bar", "lines"}
        See `progress_bar`.
    """
    if kind == "lines":
        last = -1

        def write(done: int, _: Sequence[Worker]) -> None:
            nonlocal last
            if done != last:
                print(ProgressLine(done, total), file=sys.stderr, flush=True)
                last = done

        write(done, ())
        yield write
        return
    from rich.console import Console, Group
    from rich.live import Live
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    if not (console.is_terminal and logging.getLogger("iprt").isEnabledFor(logging.INFO)):
        yield lambda *_: None
        return
    bar = Progress(
        TextColumn("rendering"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("frames"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
        console=console,
    )
    task = bar.add_task("", total=total, completed=done, left="")

    def clear() -> None:
        os.write(2, CLEAR)

    with (
        at_termination(clear),
        Live(bar, console=console, transient=True, refresh_per_second=2) as live,
    ):

        def update(done: int, workers: Sequence[Worker]) -> None:
            left = left_s(total - done, workers)
            told = "" if left is None else f"left: {timedelta(seconds=round(left))}"
            bar.update(task, completed=done, left=told)
            live.update(Group(bar, _table(workers)))

        yield update


def left_s(frames: int, workers: Sequence[Worker]) -> float | None:
    """Return the seconds that the workers need for a number of frames; None if unknown."""
    rate = sum(worker.rate or 0.0 for worker in workers if worker.works)
    return frames / rate if rate else None


def _table(workers: Sequence[Worker]) -> Table:
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in ("worker", "chunk", "frames/s", "device"):
        table.add_column(column, overflow="ellipsis", no_wrap=True)
    there = [worker for worker in workers if worker.works or worker.state == "examined"]
    for worker in there[:MOST_ROWS]:
        rate = "" if worker.rate is None else f"{worker.rate:.3g}"
        chunk = "" if worker.chunk is None else str(worker.chunk)
        table.add_row(worker.name, chunk, rate, worker.device or "is examined")
    if len(there) > MOST_ROWS:
        table.add_row(f"and {len(there) - MOST_ROWS} more")
    return table
