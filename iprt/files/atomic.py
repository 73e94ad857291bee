"""Atomic replacement of regular files."""

from __future__ import annotations

import os
import stat
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from iprt.errors import FormatError
from iprt.files.termination import at_termination


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write to the yielded path, which replaces `path` on success and is removed on failure.

    Missing folders are created. The temporary file lies in the target's folder, because a rename is
    atomic only within one file system.

    Raises
    ------
    FormatError
        The folder or the file cannot be written, or `path` is not a regular file.
    """
    require_regular(path)
    temporary = path.with_name(f".{uuid.uuid4().hex}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with at_termination(lambda: temporary.unlink(missing_ok=True)):
            try:
                yield temporary
                # Some file systems report only now that they are full. Without fsync, a power cut
                # may leave a name without its contents.
                with temporary.open("rb") as file:
                    os.fsync(file.fileno())
                os.replace(temporary, path)
            finally:
                temporary.unlink(missing_ok=True)
    except (OSError, RuntimeError) as error:  # OpenEXR reports system errors as RuntimeError
        reason = getattr(error, "strerror", None) or str(error).replace(str(temporary), path.name)
        raise FormatError(f"{path}: cannot be written: {reason}") from error


def require_regular(path: Path) -> None:
    """Refuse to replace anything but a regular file, so that no link or device is lost.

    Raises
    ------
    FormatError
        `path` is a folder, a symbolic link, a device, a pipe or a socket, or it is inaccessible.
    """
    try:
        mode = path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:  # a name too long, or a folder without search permission
        raise FormatError(f"{path}: cannot be written: {error.strerror}") from error
    if stat.S_ISDIR(mode):
        raise FormatError(f"{path}: is a folder; name a file in it")
    if stat.S_ISLNK(mode):
        target = os.path.realpath(path)
        raise FormatError(f"{path}: is a symbolic link and is not replaced; name {target} instead")
    if not stat.S_ISREG(mode):
        raise FormatError(f"{path}: is a device, pipe or socket and is not replaced; name a file")


def require_writable(path: Path) -> None:
    """Check that `path` can be written, before minutes of rendering are spent.

    Raises
    ------
    FormatError
        As `require_regular`, or its folder is a file or not writable.
    """
    require_regular(path)
    folder = Path(os.path.realpath(path.parent))
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise FormatError(f"{path}: {folder} is a file, not a folder")
    try:
        # Permissions do not tell enough: root may write everywhere, except where no file can be.
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise FormatError(f"{path}: cannot write in {folder}: {error.strerror}") from error
