"""Background threads for reading scenes and meshes, which takes long and needs no device."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable

from iprt.errors import IprtError

LOG = logging.getLogger("iprt.viewer")


class BackgroundJobs:
    """A runner of jobs, each on its own thread; the collecting thread finishes them.

    Any thread may start a job.

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
        """Names of running jobs."""
        with self._lock:
            return tuple(self._running)

    def start(
        self,
        what: str,
        job: Callable[[], Callable[[], None]],
        failed: Callable[[str], None],
    ) -> None:
        """Start a job.

        Parameters
        ----------
        what : str
            What it does, as "loading room", for messages.
        job : callable
            Runs on the thread; its result is called by `collect`.
        failed : callable
            Called by `collect` with a one-line message after a failure.
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
        """Finish completed jobs; return True if there were any."""
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
        """Wait for the jobs, which cannot be stopped, until a time of `time.monotonic`."""
        for thread in self._threads:
            thread.join(max(until_s - time.monotonic(), 0.0))
