"""What takes long and needs no device, beside the engine: scenes and meshes are read on threads."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from iprt.errors import IprtError
from iprt.scene.manifest import MANIFEST_NAME
from iprt.scene.objects import SceneObject
from iprt.scene.scene import Scene

LOG = logging.getLogger("iprt.viewer")


@dataclass(frozen=True, eq=False)
class Loaded:
    """A scene with what its files hold.

    Attributes
    ----------
    scene : Scene
    objects : tuple of SceneObject
    problem : str or None
        Why the objects are not there.
    """

    scene: Scene
    objects: tuple[SceneObject, ...]
    problem: str | None = None


def load(scene: Scene) -> Loaded:
    """Read what is needed besides frames.

    Raises
    ------
    FormatError
        An object, or what the video's files say of themselves, cannot be read.
    """
    objects = scene.objects
    # Kept by the scene: nobody waits for these files later.
    assert scene.real_materials is not None
    assert scene.source.white > 0.0
    return Loaded(scene, objects)


def load_what_can_be(scene: Scene) -> Loaded:
    """As `load`, without objects where these cannot be read.

    Raises
    ------
    FormatError
        The video's files cannot be read.
    """
    try:
        return load(scene)
    except IprtError as error:
        assert scene.source.white > 0.0
        return Loaded(scene, (), str(error))


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
        """What is loaded now."""
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


class Watch:
    """Tells when a scene's manifest was written again.

    Parameters
    ----------
    root : Path
        The scene's folder.
    """

    def __init__(self, root: Path) -> None:
        self._path = root / MANIFEST_NAME
        self._seen = self._state()

    def changed(self) -> bool:
        """Since the last call. That the file is gone, as editors have it for a moment, does not
        count."""
        now = self._state()
        if now is None or now == self._seen:
            return False
        self._seen = now
        return True

    def _state(self) -> tuple[int, int, int] | None:
        try:
            status = self._path.stat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_size, status.st_ino
