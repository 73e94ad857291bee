"""One render at a time into a folder.

Pictures of two renders in one folder get mixed up, and the later one wins where names are equal. So
a render holds a lock on the folder that it writes to, and a second one is refused at once, rather
than after minutes. The system's file lock decides, and goes with the process that holds it,
however that ends; the file's text only tells who it is.
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
NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)
"""Errors of file systems without locks: there renders are not kept apart."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold `folder`, which is made if it is missing, for the block.

    Afterwards the lock's file is gone, and so are folders made for it in which nothing was put.

    Raises
    ------
    FormatError
        Another process, or another block of this one, holds the folder; or it cannot be written, or
        something else has the name of the lock's file.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = _acquire(folder, folder / NAME)
    except OSError as error:
        raise FormatError(f"{folder}: cannot be locked: {error.strerror}") from error

    def release() -> None:
        # Before the lock is let go: the next render makes a file of its own.
        with suppress(OSError):  # the folder may have been removed
            (folder / NAME).unlink()
        os.close(handle)
        with suppress(OSError):  # not empty: something was put there
            for path in made:
                path.rmdir()

    with at_termination(release):
        try:
            yield
        finally:
            release()


def _acquire(folder: Path, path: Path) -> int:
    """The locked file, open."""
    while True:
        if path.is_symlink() or (path.exists() and not path.is_file()):
            raise FormatError(f"{path}: is not a file; delete it")
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(handle, 200, 0).decode(errors="replace") or "another process"
            os.close(handle)
            raise FormatError(
                f"{folder}: {holder} renders into this folder; wait for it or name another one"
            ) from None
        except OSError as error:
            if error.errno not in NO_LOCKS:
                os.close(handle)
                raise
        if _is_at(path, handle):
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"process {os.getpid()} on {socket.gethostname()}".encode(), 0)
            return handle
        os.close(handle)  # the one before removed it between our opening and locking it


def _is_at(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False
