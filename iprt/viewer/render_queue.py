"""A queue of renders to files, each by a process `iprt render` of its own.

A process is independent of the viewer's device and interface: it can be ended at any moment, takes
its memory with it, and a crash of the driver ends it alone.
"""

from __future__ import annotations

import logging
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any, Literal

from iprt.errors import FormatError, IprtError
from iprt.files.message_text import printable
from iprt.files.progress_line import ProgressLine
from iprt.files.termination import at_termination
from iprt.viewer.render_order import RenderOrder

LOG = logging.getLogger("iprt.viewer")
State = Literal["waiting", "rendering", "finished", "failed", "cancelled"]
COMMAND = (sys.executable, "-P", "-m", "iprt", "render")
PATIENCE_S = 2.0
"""Longest wait for a process that was asked to end."""
NICENESS = 10
"""Niceness of renders: the interface and a viewer on the same processor come first."""
NOTHING = ProgressLine(0, 0)
LONGEST = 400
"""Most characters of a problem."""


@dataclass(frozen=True)
class Render:
    """A render in the queue, at one moment.

    Attributes
    ----------
    number : int
        Number in the queue, which is kept.
    order : RenderOrder
    state : {"waiting", "rendering", "finished", "failed", "cancelled"}
    progress : ProgressLine
        Frames; view frames of a still.
    left_s : float or None
        Estimated time left in seconds; None if it is unknown.
    problem : str
        Why it failed, in one line; else empty.
    """

    number: int
    order: RenderOrder
    state: State = "waiting"
    progress: ProgressLine = NOTHING
    left_s: float | None = None
    problem: str = ""

    @property
    def open(self) -> bool:
        """True while it waits or renders."""
        return self.state in ("waiting", "rendering")

    @property
    def share(self) -> float:
        """Finished share, from 0 to 1."""
        if self.state == "finished":
            return 1.0
        return self.progress.done / max(self.progress.total, 1)


class Pace:
    """The speed of a render, without its start, which compiles and reads."""

    def __init__(self) -> None:
        self._first: ProgressLine | None = None
        self._begin: tuple[float, int] | None = None

    def left_s(self, progress: ProgressLine) -> float | None:
        """Return the seconds left after some progress; None if they are unknown."""
        now, done = time.monotonic(), progress.done
        if self._first is None or done < self._first.done:
            self._first, self._begin = progress, None
        if done == self._first.done:
            return None
        if self._begin is None:
            self._begin = now, done
        then, before = self._begin
        return None if done == before else (progress.total - done) * (now - then) / (done - before)


class RenderQueue:
    """Renders to files, one at a time in their order; all methods are thread-safe.

    Parameters
    ----------
    device : str or None
        See `choose_device`.
    """

    def __init__(self, device: str | None = None) -> None:
        self._device = device
        self._lock = threading.Lock()
        self._renders: dict[int, Render] = {}
        self._numbers = count(1)
        self._process: subprocess.Popen[str] | None = None
        self._thread: threading.Thread | None = None
        self._closed = False

    @property
    def renders(self) -> tuple[Render, ...]:
        """All renders, in their order."""
        with self._lock:
            return tuple(self._renders.values())

    @property
    def open(self) -> tuple[str, ...]:
        """Names of the files that are still to be finished."""
        return tuple(render.order.output.name for render in self.renders if render.open)

    def add(self, order: RenderOrder) -> int:
        """Append a render, and return its number.

        Raises
        ------
        IprtError
            The order is refused, or another render writes the same file.
        """
        order.check()
        with self._lock:
            if any(r.open and r.order.output == order.output for r in self._renders.values()):
                raise FormatError(f"{order.output}: is in the queue already; name another file")
            number = next(self._numbers)
            self._renders[number] = Render(number, order)
            if self._thread is None and not self._closed:
                self._thread = threading.Thread(target=self._run, name="iprt renders", daemon=True)
                self._thread.start()
        return number

    def again(self, number: int) -> None:
        """Append the same render again; a video continues with the frames that are missing.

        Raises
        ------
        IprtError
            As `add`; the ended render stays.
        """
        with self._lock:
            ended = self._renders[number]
        self.add(ended.order)
        self.forget(number)

    def cancel(self, number: int) -> None:
        """End a render; finished frames of a video stay."""
        with self._lock:
            render = self._renders.get(number)
            if render is None or not render.open:
                return
            self._renders[number] = replace(render, state="cancelled", left_s=None)
            if render.state == "rendering":
                self._end()

    def forget(self, number: int) -> None:
        """Remove an ended render from the list; its file stays."""
        with self._lock:
            if number in self._renders and not self._renders[number].open:
                del self._renders[number]

    def cancel_all(self) -> None:
        """End all renders."""
        for render in reversed(self.renders):  # the running one last, so that none follows it
            self.cancel(render.number)

    def close(self) -> None:
        """Cancel all renders, and wait for their processes."""
        with self._lock:
            self._closed = True
            thread = self._thread
        self.cancel_all()
        if thread is not None:
            thread.join(2.0 * PATIENCE_S)

    def _end(self) -> None:
        """Ask the process to end, and kill it if it does not."""
        process = self._process
        if process is not None:
            process.terminate()
            killer = threading.Timer(PATIENCE_S, process.kill)
            killer.daemon = True
            killer.start()

    # The queue's thread -----------------------------------------------------------------------

    def _run(self) -> None:
        while (render := self._next()) is not None:
            try:
                problem = self._render(render)
            except IprtError as error:
                problem = str(error)
            except OSError as error:
                problem = f"{error.filename}: {error.strerror}"
            except Exception as error:
                LOG.exception("a defect of iprt")
                problem = f"a defect of iprt: {type(error).__name__}: {error}"
            with self._lock:
                self._process = None
                state: State = "failed" if problem else "finished"
                self._change(render.number, state=state, left_s=None, problem=problem)

    def _next(self) -> Render | None:
        with self._lock:
            waiting = (r for r in self._renders.values() if r.state == "waiting")
            render = None if self._closed else next(waiting, None)
            if render is None:
                self._thread = None
            else:
                self._change(render.number, state="rendering")
            return render

    def _change(self, number: int, **parts: Any) -> None:
        """Change a render that is not cancelled, nor forgotten after that."""
        render = self._renders.get(number)
        if render is not None and render.open:
            self._renders[number] = replace(render, **parts)

    def _render(self, render: Render) -> str:
        """Render to the file; return the problem, or an empty text."""
        with tempfile.TemporaryDirectory(prefix="iprt-render-") as name:
            folder = Path(name)

            def leave() -> str:
                self._leave()
                shutil.rmtree(folder, ignore_errors=True)
                return f"not rendered to the end: {', '.join(self.open)}"

            with at_termination(leave):
                words = render.order.prepare(folder)
                if self._device is not None:
                    words.append(f"--device={self._device}")
                return self._follow(render, words, folder)

    def _leave(self) -> None:
        """End the process while a signal ends this one."""
        process = self._process
        if process is not None:
            process.terminate()
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()

    def _follow(self, render: Render, words: list[str], folder: Path) -> str:
        """Run the process to its end, and follow its progress."""
        with self._lock:
            now = self._renders.get(render.number)
            if now is None or not now.open:  # cancelled meanwhile
                return ""
            process = self._process = subprocess.Popen(
                [*COMMAND, *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
            )
        with suppress(OSError):  # it may have ended
            os.setpriority(os.PRIO_PROCESS, process.pid, NICENESS)
        last, pace = "", Pace()
        with process:
            assert process.stderr is not None
            for line in process.stderr:
                text = line.rstrip("\n")
                progress = ProgressLine.of(text)
                if progress is None:
                    last = text or last
                    continue
                left_s = None if render.order.converges else pace.left_s(progress)
                with self._lock:
                    self._change(render.number, progress=progress, left_s=left_s)
        if process.returncode == 0:
            return ""
        reason = last.removeprefix("iprt: ").removeprefix("error: ")
        shown = reason.replace(str(folder / "scene"), str(render.order.scene.origin.root))
        return printable(shown, LONGEST) or f"it ended with code {process.returncode}"
