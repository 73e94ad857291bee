"""Reading of untrusted files: limits on sizes and links, and one error for all damage.

Declared sizes are checked before memory is allocated. A scene's files stay in its folder; links
that lead out of it need permission.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import BinaryIO

from iprt.errors import FormatError
from iprt.files.message_text import printable

MAX_SIDE = 16384
"""Limit for the sides of a picture in pixels."""
MAX_PIXELS = 2**27
"""Limit for the pixels of a picture, and of all textures of a mesh file: a 16384 x 8192
panorama."""
MAX_BYTES = 2**31
"""Limit for the bytes of a file that is read whole, and of its decoded contents."""
MAX_TRIANGLES = 2**24
"""Limit for the triangles of a mesh, the same as the renderer's."""
MAX_VERTICES = 3 * MAX_TRIANGLES
MAX_OBJECTS = 1024
"""Limit for the objects of a scene: the renderer's tree over them has ten levels."""


def require_picture_size(path: Path, width: int, height: int) -> None:
    """Raise FormatError if a picture of this size is not read."""
    if width < 1 or height < 1 or max(width, height) > MAX_SIDE or width * height > MAX_PIXELS:
        raise FormatError(
            f"{path}: claims {width} x {height} pixels; at most {MAX_SIDE} a side and "
            f"{MAX_PIXELS} in all are read"
        )


def is_file(path: Path) -> bool:
    """Return `Path.is_file`; False for impossible names and unsearchable folders."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def identity(path: Path) -> tuple[int, int] | None:
    """Return numbers that tell a file from all others, links followed; None if there is none."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


def read_bytes(path: Path, most: int = MAX_BYTES) -> bytes:
    """Read a whole file of at most `most` bytes.

    Raises
    ------
    FormatError
        The file is larger, or unreadable.
    """
    with open_file(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most:
            raise FormatError(f"{path}: {size} bytes; at most {most} are read")
        return file.read(size)


def open_file(path: Path) -> BinaryIO:
    """Open a file for reading.

    Raises
    ------
    FormatError
        There is no such file, or it cannot be read.
    """
    try:
        # A pipe or a device has no end, and opening one may block.
        if path.exists() and not path.is_file() and not path.is_dir():
            raise FormatError(f"{path}: not a file")
        return path.open("rb")
    except FileNotFoundError as error:
        raise FormatError(f"{path}: no such file") from error
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror})") from error


@contextmanager
def decoding(path: Path, complaint: str) -> Iterator[None]:
    """Convert any exception of a library's decoder into a FormatError about `path`.

    FormatError and MemoryError pass unchanged.
    """
    try:
        yield
    except (FormatError, MemoryError):
        raise
    except Exception as error:
        lines = str(error).splitlines()
        reason = f" ({printable(lines[0])})" if lines else ""
        raise FormatError(f"{path}: {complaint}{reason}") from error


def stays_inside(name: str) -> bool:
    """Return True if a relative path, with slashes or backslashes, never leaves its folder."""
    path = PurePosixPath(name.replace("\\", "/"))
    depth = 0
    for part in path.parts:
        depth += -1 if part == ".." else 1
        if depth < 0:
            return False
    return not path.is_absolute() and not PureWindowsPath(name).drive


def require_inside(path: Path, folder: Path) -> None:
    """Raise FormatError unless `path`, with links resolved, lies in `folder`.

    The root of the file system as `folder` permits everything.
    """
    real, home = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
    if not real.is_relative_to(home):
        raise FormatError(
            f"{path}: is a link to {real}, outside its folder; copy it there, or give "
            "--allow-outside"
        )


def reference_beside(path: Path, name: str) -> Path:
    """Return the relative path of a file that the file at `path` refers to by `name`.

    Raises
    ------
    FormatError
        It must not be read: it is on the net, or outside of the folder.
    """
    relative = PurePosixPath(name.replace("\\", "/"))
    name = printable(name)
    if "://" in name:
        raise FormatError(f"{path}: refers to {name} on the net; copy it beside it")
    if relative.is_absolute() or ".." in relative.parts:
        raise FormatError(f"{path}: refers to {name}, outside its folder; copy it in")
    return Path(relative)


def anywhere(folder: Path) -> Path:
    """Return a folder for `require_inside` that permits every file."""
    return Path(Path(os.path.realpath(folder)).anchor)
