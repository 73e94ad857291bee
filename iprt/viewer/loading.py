"""Scenes and meshes are read on threads of their own, since they take long and need no device."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable

from iprt.errors import IprtError

LOG = logging.getLogger("iprt.viewer")


class Loader:
    """Runs jobs, each on a thread of its own; what they return is done by who collects it.

    Any thread may start one.

    Parameters
    ----------
    wake : callable
        Called by a thread when its job is finished.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._results: queue.SimpleQueue[tuple[str, Callable[[], None]]] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._threads: list[threading.Thread] = []
        self._running: list[str] = []

    @property
    def running(self) -> tuple[str, ...]:
        """Names of the jobs under way."""
        with self._lock:
            return tuple(self._running)

    def start(
        self,
        what: str,
        job: Callable[[], Callable[[], None]],
        failed: Callable[[str], None],
    ) -> None:
        """Begin a job.

        Parameters
        ----------
        what : str
            Is loaded, in words.
        job : callable
            Runs on the thread; what it returns is called by `collect`.
        failed : callable
            Called by `collect` with what went wrong, in one line, if it did.
        """

        def run() -> None:
            try:
                finish = job()
            except IprtError as error:
                message = str(error)
                self._results.put((what, lambda: failed(message)))
            except Exception as error:
                LOG.exception("%s", what)
                message = f"{what}: {type(error).__name__}: {error}"
                self._results.put((what, lambda: failed(message)))
            else:
                self._results.put((what, finish))
            self._wake()

        thread = threading.Thread(target=run, name="iprt loading", daemon=True)
        with self._lock:
            self._threads = [known for known in self._threads if known.is_alive()] + [thread]
            self._running.append(what)
            thread.start()

    def collect(self) -> bool:
        """Do what finished jobs returned; whether there were any."""
        found = False
        while True:
            try:
                what, finish = self._results.get_nowait()
            except queue.Empty:
                return found
            with self._lock:
                self._running.remove(what)
            finish()
            found = True

    def close(self, until_s: float) -> None:
        """Wait for the jobs, up to a time of `time.monotonic`: they cannot be stopped."""
        for thread in self._threads:
            thread.join(max(until_s - time.monotonic(), 0.0))
