"""A lock that allows one film at a time into a folder, and one viewer to an autosave.

Two renders into one folder would mix their pictures, and overwrite equal names. A render therefore
locks its output folder, and a second one is refused at once. Renders of chunks of a film share the
lock. The operating system's file lock decides. It ends with the process that holds it. The text in
the lock file only names the holder.
"""

from __future__ import annotations

import errno
import fcntl
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from iprt.errors import FormatError
from iprt.files.termination import at_termination

NAME = ".iprt.lock"
RENDERS = "renders into this folder; wait for it or name another one"
NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)
"""Errors of file systems without locks, on which renders are not kept apart."""


@contextmanager
def locked(folder: Path, taken: str = RENDERS, *, shared: bool = False) -> Iterator[None]:
    """Lock `folder`, which is created if missing, during the block.

    Afterwards the last holder removes the lock file, and created folders that are still empty.
    `taken` tells what another process does that holds the folder, and the advice. A `shared` lock
    excludes only others that are not.

    Raises
    ------
    FormatError
        Another process, or another block of this one, holds the folder. Or the folder cannot be
        written, or the lock file's name is taken by something else.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = _acquire(folder, folder / NAME, taken, shared)
    except OSError as error:
        raise FormatError(f"{folder}: cannot be locked: {error.strerror}") from error

    def release() -> None:
        with suppress(OSError):  # the folder may have been removed
            # Delete before unlocking: the next render creates a file of its own.
            if not shared or _alone(handle):
                (folder / NAME).unlink()
        os.close(handle)
        with suppress(OSError):  # not empty
            for path in made:
                path.rmdir()

    with at_termination(release):
        try:
            yield
        finally:
            release()


def _acquire(folder: Path, path: Path, taken: str, shared: bool) -> int:
    """Open and lock the lock file; return its descriptor."""
    while True:
        if path.is_symlink() or (path.exists() and not path.is_file()):
            raise FormatError(f"{path}: is not a file; delete it")
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        try:
            fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(handle, 200, 0).decode(errors="replace") or "another process"
            os.close(handle)
            raise FormatError(f"{folder}: {holder} {taken}") from None
        except OSError as error:
            if error.errno not in NO_LOCKS:
                os.close(handle)
                raise
        if _is_at(path, handle):
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"process {os.getpid()} on {socket.gethostname()}".encode(), 0)
            return handle
        os.close(handle)  # the previous holder removed it between opening and locking


def _alone(handle: int) -> bool:
    """Return whether no other process shares the lock."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is_at(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False
