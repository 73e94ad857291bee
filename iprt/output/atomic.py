"""Files appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from iprt.errors import FormatError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write to the yielded path; on success it becomes `path`, on failure nothing is left behind.

    Missing folders are created. The temporary file lies in the target's folder, because a rename
    is atomic only within one file system.

    Raises
    ------
    FormatError
        The folder or the file cannot be written.
    """
    # A link keeps pointing where it did: its target is replaced.
    target = Path(os.path.realpath(path))
    temporary = target.with_name(f".{uuid.uuid4().hex}.tmp")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield temporary
            _sync(temporary)
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)
    except (OSError, RuntimeError) as error:  # OpenEXR reports system errors as RuntimeError
        reason = getattr(error, "strerror", None) or str(error).replace(str(temporary), path.name)
        raise FormatError(f"{path}: cannot be written: {reason}") from error


def _sync(path: Path) -> None:
    # Some file systems tell only now that they are full, and after a power cut a name may stand for
    # a file whose contents never reached the disk.
    with path.open("rb") as file:
        os.fsync(file.fileno())


def require_writable(path: Path) -> None:
    """Fail now rather than after minutes of rendering if `path` cannot be written.

    Raises
    ------
    FormatError
        `path` is a folder, or the folder it goes to is not one, or permits no writing.
    """
    target = Path(os.path.realpath(path))
    try:
        target.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # a name too long, a folder that may not be searched
        raise FormatError(f"{path}: cannot be written: {error.strerror}") from error
    if target.is_dir():
        raise FormatError(f"{path}: is a folder; name a file in it")
    folder = target.parent
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise FormatError(f"{path}: {folder} is a file, not a folder")
    try:
        # Only trying tells: root may write everywhere, except where no file can be.
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise FormatError(f"{path}: cannot write in {folder}: {error.strerror}") from error
