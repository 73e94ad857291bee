"""A progress bar on stderr, where somebody watches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from iprt.ending import raise_if_ended


@contextmanager
def progress_bar(
    label: str, frames: int, unit: str = "frames", *, done: int = 0, remaining: bool = False
) -> Iterator[Callable[[int], None]]:
    """Show a bar while the block runs; call what it yields with the number of frames done.

    Nothing is written where stderr is no terminal: a log would only get empty lines.

    Parameters
    ----------
    done : int
        Frames that were finished before.
    remaining : bool
        Show the time left and the seconds per frame, too.
    """
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
    columns: tuple[ProgressColumn, ...] = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeElapsedColumn(),
    )
    if remaining:
        columns += (TextColumn("left:"), TimeRemainingColumn(), SecondsPerFrame())
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task(label, total=frames, completed=done)

        def update(done: int) -> None:
            raise_if_ended()
            bar.update(task, completed=done)

        yield update
