"""Reading files that may hold anything: how large they may be, and one error for all damage.

Sizes are checked on what headers claim, before memory is taken for it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from iprt.errors import FormatError
from iprt.files.toml_text import printable

MAX_SIDE = 16384
"""Pixels along a side of any picture."""
MAX_PIXELS = 2**27
"""A picture has no more, nor have all textures of a mesh file together: a 16384 x 8192 panorama."""
MAX_BYTES = 2**31
"""A file that is read whole has no more, nor has what is decoded from it."""
MAX_TRIANGLES = 2**24
"""A mesh has no more: the renderer draws as many."""
MAX_VERTICES = 3 * MAX_TRIANGLES
MAX_OBJECTS = 1024
"""A scene has no more: the renderer's tree over them has ten levels."""


def require_picture_size(path: Path, width: int, height: int) -> None:
    """Raise FormatError if a picture that claims this size is not read."""
    if width < 1 or height < 1 or max(width, height) > MAX_SIDE or width * height > MAX_PIXELS:
        raise FormatError(
            f"{path}: claims {width} x {height} pixels; at most {MAX_SIDE} a side and "
            f"{MAX_PIXELS} in all are read"
        )


def is_file(path: Path) -> bool:
    """`Path.is_file`, also for names that no file can have and folders that may not be searched."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_bytes(path: Path, most: int = MAX_BYTES) -> bytes:
    """All of a file that is not larger than `most` bytes.

    Raises
    ------
    FormatError
        Larger, or not readable.
    """
    with open_file(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most:
            raise FormatError(f"{path}: {size} bytes; at most {most} are read")
        return file.read(size)


def open_file(path: Path) -> BinaryIO:
    """Open for reading.

    Raises
    ------
    FormatError
        There is no such file, or it cannot be read.
    """
    try:
        # A pipe or a device has no end, and opening one may wait for ever.
        if path.exists() and not path.is_file() and not path.is_dir():
            raise FormatError(f"{path}: not a file")
        return path.open("rb")
    except FileNotFoundError as error:
        raise FormatError(f"{path}: no such file") from error
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror})") from error


@contextmanager
def decoding(path: Path, complaint: str) -> Iterator[None]:
    """Turn what a library's decoder raises, of whatever kind, into a FormatError about `path`.

    Errors that are for the user already, and lack of memory, pass.
    """
    try:
        yield
    except (FormatError, MemoryError):
        raise
    except Exception as error:
        lines = str(error).splitlines()
        reason = f" ({printable(lines[0])})" if lines else ""
        raise FormatError(f"{path}: {complaint}{reason}") from error
