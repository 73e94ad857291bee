"""Running viewers of the user on this machine, by a file each.

A file names the port at which a viewer listens, and a token that requests need. Only the user can
read it, so that web pages and other users cannot control the viewer. The viewer locks its file. A
file without a lock is left from a process that was killed, and is removed.
"""

from __future__ import annotations

import fcntl
import json
import logging
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from platformdirs import user_state_path

from iprt.errors import IprtError
from iprt.files.termination import at_termination

LOG = logging.getLogger("iprt.viewer")


@dataclass(frozen=True)
class Running:
    """A running viewer.

    Attributes
    ----------
    port : int
        Port at which it takes requests.
    token : str
    scene : str
        Path of the scene.
    web : int or None
        Port of its browsers; None for a window.
    """

    port: int
    token: str
    scene: str
    web: int | None

    def __str__(self) -> str:
        place = f"port {self.port}, in a window" if self.web is None else f"port {self.web}"
        return f"{self.scene} ({place})"


def folder() -> Path:
    """Return the folder of the files; it may not exist."""
    return user_state_path("iprt") / "viewers"


@contextmanager
def announced(viewer: Running) -> Iterator[None]:
    """Let `running` find a viewer during the block; only warn if the file cannot be written."""
    # Homes may be shared by machines.
    path = folder() / f"{socket.gethostname()}-{viewer.port}.json"
    try:
        handle = _written(path, viewer)
    except OSError as error:
        LOG.warning("`iprt remote` cannot find this viewer: %s: %s", path, error.strerror)
        yield
        return
    try:
        with at_termination(lambda: path.unlink(missing_ok=True)):
            yield
    finally:
        path.unlink(missing_ok=True)
        os.close(handle)


def _written(path: Path, viewer: Running) -> int:
    """Write a viewer's file, and return the descriptor that locks it."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    new = path.with_suffix(".new")
    new.unlink(missing_ok=True)
    handle = os.open(new, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        os.write(handle, json.dumps(asdict(viewer)).encode())
        os.replace(new, path)  # only locked files have their final name
    except OSError:
        os.close(handle)
        new.unlink(missing_ok=True)
        raise
    return handle


def running() -> list[Running]:
    """Return the running viewers, newest first; files of dead ones are removed."""
    found = []
    for path in folder().glob(f"{socket.gethostname()}-*.json"):
        with suppress(OSError, ValueError, TypeError), path.open("rb") as file:
            if _locked(file.fileno()):
                viewer = Running(**json.loads(file.read()))
                found.append((os.fstat(file.fileno()).st_mtime_ns, viewer))
            else:
                path.unlink(missing_ok=True)
    return [viewer for _, viewer in sorted(found, key=lambda entry: entry[0], reverse=True)]


def _locked(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    return False


def choose(port: int | None) -> Running:
    """Return the running viewer of a port, by default the newest.

    Parameters
    ----------
    port : int or None
        Port of its requests, or of its browsers.

    Raises
    ------
    IprtError
        There is none.
    """
    found = running()
    if not found:
        raise IprtError("no viewer is running; start one with `iprt view SCENE`")
    for viewer in found:
        if port in (None, viewer.port, viewer.web):
            return viewer
    known = ", ".join(map(str, found))
    raise IprtError(f"no viewer is running at port {port}; these are: {known}")
