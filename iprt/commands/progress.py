"""A progress bar on stderr, where somebody watches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from iprt.ending import raise_if_ended


@contextmanager
def progress_bar(label: str, frames: int, unit: str = "frames") -> Iterator[Callable[[int], None]]:
    """Show a bar while the block runs; call what it yields with the number of frames done.

    Nothing is written where stderr is no terminal: a log would only get empty lines.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeElapsedColumn(),
    )
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task(label, total=frames)

        def update(done: int) -> None:
            raise_if_ended()
            bar.update(task, completed=done)

        yield update
