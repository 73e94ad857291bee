"""The common parts of the methods of `Control`: acting in windows, and finding objects."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, wait

from iprt.errors import IprtError
from iprt.files.message_text import printable
from iprt.viewer.engine import Engine
from iprt.viewer.object_states import ObjectState
from iprt.viewer.program.pictures import wait_ready, wait_until
from iprt.viewer.ui_state import UiState
from iprt.viewer.windows import Windows

WINDOW_S = 5.0
"""Longest wait for windows to follow."""
LOADING_S = 300.0
"""Longest wait for files."""


class ControlBase:
    """Access of programs to an engine and its windows; see `Control`."""

    def __init__(self, engine: Engine, windows: Windows) -> None:
        self._engine, self._windows = engine, windows

    def _everywhere(self, act: Callable[[UiState], object]) -> None:
        """Act in all windows, on their own threads, and wait until it is done."""
        waiting: list[Future[None]] = []

        def schedule(ui: UiState, done: Future[None]) -> None:
            def run() -> None:
                try:
                    act(ui)
                except Exception as error:
                    done.set_exception(error)
                else:
                    done.set_result(None)

            ui.post(done, run)

        for ui in self._windows.states:
            waiting.append(Future())
            schedule(ui, waiting[-1])
        # Windows that close meanwhile never answer.
        for done in wait(waiting, WINDOW_S).done:
            done.result()

    def _objects(self) -> tuple[ObjectState, ...]:
        """Return the objects with all edits."""
        states = (self._engine.object_state(state.name) for state in self._engine.objects)
        return tuple(state for state in states if state is not None)

    def _state(self, name: str) -> ObjectState:
        """Return an object, once the objects are known."""
        wait_ready(self._engine, time.monotonic() + LOADING_S)
        objects = {state.name: state for state in self._objects()}
        if name not in objects:
            known = ", ".join(objects) or "none"
            raise IprtError(f"no object is named '{printable(name)}'; the objects are: {known}")
        return objects[name]

    def _shows(self, state: ObjectState) -> bool:
        shown = self._windows.seen.objects
        return shown is None or state.name in shown

    def _finish(self, done: Future[str | None], until_s: float, what: str) -> None:
        """Wait for the engine, and raise the problem that it reports."""
        wait_until(self._engine, done.done, until_s, what)
        if (problem := done.result()) is not None:
            raise IprtError(problem)
