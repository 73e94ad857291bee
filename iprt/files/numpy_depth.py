"""Depth in NumPy's formats: `.npy`, and `.npz` with one array or one named as depth."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.message_text import printable
from iprt.files.safe_reading import decoding, open_file, require_picture_size

NAMES = ("depth", "distance")
"""Names of depth among several arrays of an `.npz` file."""


def read_numpy(path: Path) -> NDArray[Any]:
    """Read depth (H, W) as stored, integers or floats; (H, W, 1) and (1, H, W) are accepted.

    Pickled data are refused.

    Raises
    ------
    FormatError
        The file is cut off, damaged or too large, has another shape or type, or holds several
        arrays of which none is named as depth.
    """
    with decoding(path, "cut off or damaged NumPy file"), open_file(path) as file:
        if file.read(4) == b"PK\x03\x04":
            with zipfile.ZipFile(file) as archive, archive.open(_member(path, archive)) as member:
                return _array(path, member)
        file.seek(0)
        return _array(path, file)


def _member(path: Path, archive: zipfile.ZipFile) -> str:
    names = [name for name in archive.namelist() if name.endswith(".npy")]
    if len(names) == 1:
        return names[0]
    for wanted in NAMES:
        if f"{wanted}.npy" in names:
            return f"{wanted}.npy"
    has = ", ".join(printable(name.removesuffix(".npy"), 40) for name in names[:20]) or "none"
    raise FormatError(f"{path}: needs one array, or one that is named depth; it has {has}")


def _array(path: Path, file: Any) -> NDArray[Any]:
    """Read an array, and check its header before allocating memory."""
    version = npy_format.read_magic(file)
    read_header = {
        (1, 0): npy_format.read_array_header_1_0,
        (2, 0): npy_format.read_array_header_2_0,
    }.get(version)
    if read_header is None:
        raise FormatError(f"{path}: version {version[0]} of NumPy's format is not read")
    shape, by_columns, kind = read_header(file)
    plane = tuple(side for side in shape if side != 1) if len(shape) == 3 else shape
    if len(plane) != 2 or kind.kind not in "uif" or kind.itemsize > 8:
        raise FormatError(
            f"{path}: holds {' x '.join(map(str, shape)) or 'one'} {kind}; depth needs rows x "
            "columns of integers or floats"
        )
    height, width = plane
    require_picture_size(path, width, height)
    needed = height * width * kind.itemsize
    data = _exactly(file, needed)
    if data is None:
        raise FormatError(f"{path}: cut off NumPy file: fewer than {needed} bytes of values")
    values = np.frombuffer(data, kind)
    return values.reshape(plane, order="F" if by_columns else "C")


def _exactly(file: BinaryIO, count: int) -> bytes | None:
    data = file.read(count)
    return data if len(data) == count else None
