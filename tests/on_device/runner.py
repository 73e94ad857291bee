"""Steps in child processes: what a driver does to one of them ends one case only."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.on_device.cases import Row

ROOT = Path(__file__).resolve().parents[2]
START_S = 120.0
"""Longest time until a child has imported what it needs, and found its cases."""
ENDING_S = 5.0
"""How long the end of a process is waited for: one inside a driver may never come."""


@dataclass(frozen=True)
class Step:
    """A part of the whole.

    Attributes
    ----------
    name, title : str
    module : str
        Has a function `cases(asked)`.
    most_s : float
        Time it gets at first; more if others leave some.
    case_s : float
        Time after which one of its cases hangs.
    environment : dict of str to str
    """

    name: str
    title: str
    module: str
    most_s: float
    case_s: float = 60.0
    environment: dict[str, str] = field(default_factory=dict)


@dataclass
class Outcome:
    """What has come of a step so far.

    Attributes
    ----------
    failed : str
        Why it has no cases; empty if it has.
    cases : list of str
        All of them.
    done : dict of str to dict
        Of those that have come to an end, `rows` and `seconds`, or the `problem`.
    """

    failed: str = ""
    cases: list[str] | None = None
    done: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def left(self) -> list[str]:
        """Cases that did not fit."""
        return [name for name in self.cases or () if name not in self.done]

    @property
    def finished(self) -> bool:
        return bool(self.failed) or (self.cases is not None and not self.left)

    def rows(self, name: str) -> list[Row]:
        """Those of a case; empty without."""
        found: list[Row] = self.done.get(name, {}).get("rows", [])
        return found


def run(
    step: Step,
    outcome: Outcome,
    *,
    device: str,
    until: float,
    folder: Path,
    ended: Callable[[str], None],
) -> None:
    """Run what is left of a step, in as many processes as it takes.

    Parameters
    ----------
    outcome : Outcome
        Is added to.
    until : float
        When it ends, in seconds of `time.monotonic`.
    folder : Path
        Its `log.txt` takes what the processes print.
    ended : callable
        Called with the name of each case that has come to an end.
    """
    while not outcome.finished and time.monotonic() < until:
        before = len(outcome.done)
        begun = ""
        with _Child(step, device, until, folder, list(outcome.done)) as child:
            for message in child.messages(until):
                if "failed" in message:
                    outcome.failed = message["failed"]
                elif "cases" in message:
                    outcome.cases = message["cases"]
                elif "begin" in message:
                    begun = message["begin"]
                elif begun:
                    outcome.done[begun] = message
                    ended(begun)
                    begun = ""
        if child.why and begun:
            outcome.done[begun] = {"problem": child.why}
            ended(begun)
        elif child.why and outcome.cases is None:
            outcome.failed = f"nothing could be begun: {child.why}"
        if len(outcome.done) == before:
            return  # out of time, or nothing that another process would do better


class _Child:
    """The process of a step.

    Attributes
    ----------
    why : str
        Why it ended early, if that is its own fault or its case's; known at the end.
    """

    def __init__(
        self, step: Step, device: str, until: float, folder: Path, done: list[str]
    ) -> None:
        self._step = step
        self._pipe, given = os.pipe()
        self._log = (folder / "log.txt").open("ab")
        self._log.write(f"\n== {step.name}\n".encode())
        self._log.flush()
        words = [str(given), step.module, device, str(until), *done]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.on_device.child", *words],
            cwd=ROOT,
            env={**os.environ, **step.environment},
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            pass_fds=(given,),
            process_group=0,  # with all that it starts
        )
        os.close(given)
        self._closed = False
        self.why = ""

    def __enter__(self) -> _Child:
        return self

    def __exit__(self, *_: object) -> None:
        itself = self._closed and self._ends()
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        status = self._process.returncode if itself or self._ends() else None
        if itself and status is not None and status < 0:
            self.why = f"the process was ended by {signal.Signals(-status).name}"
        elif itself and status not in (0, 1):
            self.why = f"the process ended with status {status}"
        os.close(self._pipe)
        self._log.close()

    def _ends(self) -> bool:
        """Whether it does so soon."""
        try:
            self._process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            return False
        return True

    def messages(self, until: float) -> Iterator[dict[str, Any]]:
        """Until it ends, hangs, or time is up."""
        held, limit = b"", START_S
        while True:
            end = min(time.monotonic() + limit, until)
            if not select.select([self._pipe], [], [], max(end - time.monotonic(), 0.0))[0]:
                if end < until:
                    self.why = f"no answer within {limit:.0f} s"
                return
            chunk = os.read(self._pipe, 1 << 16)
            if not chunk:
                self._closed = True
                return
            limit = self._step.case_s
            *lines, held = (held + chunk).split(b"\n")
            yield from map(json.loads, lines)
