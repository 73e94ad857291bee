"""A task of a worker: one chunk of a film, rendered by a process of its own.

A driver that crashes or hangs takes only this process along. It lies in a process group of its own,
with the compilers that it starts, and ends when the worker does.
"""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import IO, Any

from iprt.farm.order import Order, Outcome
from iprt.files.message_text import printable
from iprt.files.progress_line import ProgressLine
from iprt.files.termination import PATIENCE_S

POLL_S = 0.25
TOLD_EVERY_S = 0.5
"""Shortest time between two events of a worker."""
LONGEST = 400
"""Most characters of a line that is passed on."""
MOST_REMARKS = 20
HUNG, ENDED = 124, 143
"""Exit statuses of processes that hung, and that were not wanted any longer."""


def render_chunk(order: Order, number: int) -> Outcome:
    """Render a chunk on this worker; tell the progress by events.

    The process ends early if the task is cancelled, if its client is gone, or if the worker closes.
    """
    from distributed import get_worker

    worker = get_worker()
    key, start, heard, told = worker.get_current_task(), time.monotonic(), time.monotonic(), 0.0
    first: ProgressLine | None = None
    last, reason = ProgressLine(0, 0), ""
    remarks: list[str] = []

    def tell() -> None:
        worker.log_event(
            order.topic, {"chunk": number, "worker": worker.address, "done": last.done}
        )

    tell()
    words = [*order.words, f"--chunks={number}", "--progress=lines"]
    with _child(words) as process:
        assert process.stderr is not None
        for line in _lines(process.stderr):
            now = time.monotonic()
            if not _wanted(worker, key):
                _end(process)
                return Outcome(ENDED, 0, now - start, "not wanted any longer")
            if line is None:
                if now - heard > order.patience_s:
                    os.killpg(process.pid, signal.SIGKILL)
                    hangs = f"no progress for {now - heard:.0f} s: it hangs, and was ended"
                    return Outcome(HUNG, last.done - (first or last).done, now - start, hangs)
                continue
            heard = now
            progress = ProgressLine.of(line)
            if progress is None:
                if reason and len(remarks) < MOST_REMARKS:
                    remarks.append(reason)
                reason = printable(line.removeprefix("iprt: "), LONGEST) or reason
                continue
            first, last = first or progress, progress
            if now - told > TOLD_EVERY_S:
                told = now
                tell()
        code = process.wait()
    tell()
    frames, seconds = last.done - (first or last).done, time.monotonic() - start
    if code == 0:
        return Outcome(0, frames, seconds, "", (*remarks, reason) if reason else tuple(remarks))
    reason = reason.removeprefix("error: ") or _ended_by(code)
    return Outcome(code, frames, seconds, reason, tuple(remarks))


def environment() -> dict[str, str]:
    """Return the environment of renders, without the numbers of threads that dask sets.

    With them, fits might differ in their last bits between processes.
    """
    import dask

    given = dask.config.get("distributed.nanny.pre-spawn-environ", {})
    return {name: text for name, text in os.environ.items() if str(given.get(name)) != text}


@contextmanager
def _child(words: list[str]) -> Iterator[subprocess.Popen[str]]:
    """Start a render; it has ended after the block."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "iprt.farm.child", *words],
        env=environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        process_group=0,
    )
    with process:
        try:
            yield process
        finally:
            if process.poll() is None:
                _end(process)


def _end(process: subprocess.Popen[str]) -> None:
    """Ask the process to end, and kill its group if it does not."""
    process.terminate()
    with suppress(subprocess.TimeoutExpired):
        process.wait(PATIENCE_S)
        return
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _lines(pipe: IO[str]) -> Iterator[str | None]:
    """Yield lines without their ends until the pipe closes; None at least every `POLL_S`."""
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def read() -> None:
        with suppress(ValueError):  # the pipe is closed on this side
            for line in pipe:
                lines.put(line.rstrip("\n"))
        lines.put(None)

    threading.Thread(target=read, daemon=True).start()
    while True:
        try:
            line = lines.get(timeout=POLL_S)
        except queue.Empty:
            yield None
            continue
        if line is None:
            return
        yield line


def _wanted(worker: Any, key: Any) -> bool:
    """Return whether the worker goes on, and the scheduler still wants the task."""
    from distributed.core import Status

    state = worker.state.tasks.get(key)
    running = worker.status in (Status.running, Status.paused)
    return running and state is not None and state.state == "executing"


def _ended_by(code: int) -> str:
    if code >= 0:
        return f"it ended with code {code}"
    with suppress(ValueError):
        return f"it was ended by {signal.Signals(-code).name}"
    return f"it was ended by signal {-code}"
