"""OpenEXR pictures: header checked first, then decoded by the OpenEXR library.

The header is parsed here because the library allocates what a header claims and writes its
complaints about cut-off files to stdout. Layout: "OpenEXR File Layout",
https://openexr.com/en/latest/OpenEXRFileLayout.html.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError

MAGIC = b"\x76\x2f\x31\x01"
MAX_PIXELS = 2**28
"""Pictures that claim more pixels are refused before anything is allocated."""

_MAX_ATTRIBUTE_BYTES = 2**24
_DEEP = 0x800
_MULTIPART = 0x1000
_TILED = 0x200
_LINES_PER_CHUNK = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}
"""By the compression code: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB."""


@dataclass(frozen=True)
class _Header:
    channels: dict[str, tuple[int, int]]
    width: int
    height: int
    compression: int
    tiled: bool


def read_exr(path: Path, choices: Sequence[tuple[str, ...]]) -> list[NDArray[np.generic]]:
    """Read the first of `choices` that the file holds.

    Parameters
    ----------
    path : Path
    choices : sequence of tuple of str
        Sets of channel names in order of preference. A set may lie in a layer
        (`beauty.R, beauty.G, beauty.B`); channels without a layer go first. The set `("*",)`
        stands for the only channel of a file that has one.

    Returns
    -------
    list of (H, W) array
        float16, float32 or uint32, one per name of the set.

    Raises
    ------
    FormatError
        Cut off or damaged, deep or multi-part, cropped, too large, or without such channels.
    """
    header = _checked_header(path)
    names = _choose(path, list(header.channels), choices)
    for name in names:
        if header.channels[name] != (1, 1):
            raise FormatError(f"{path}: channel {name} is subsampled; save it at full resolution")
    import OpenEXR

    try:
        channels = OpenEXR.File(os.fspath(path), separate_channels=True).channels()
        planes = [np.asarray(channels[name].pixels) for name in names]
    except (RuntimeError, ValueError, KeyError, MemoryError) as error:
        raise FormatError(f"{path}: damaged EXR file ({_first_line(error)})") from error
    if any(plane.shape != (header.height, header.width) for plane in planes):
        raise FormatError(f"{path}: damaged EXR file (its pixels do not match its header)")
    return planes


def exr_size(path: Path) -> tuple[int, int]:
    """Width and height, from the header; the file is checked for completeness."""
    header = _checked_header(path)
    return header.width, header.height


def _choose(path: Path, present: list[str], choices: Sequence[tuple[str, ...]]) -> list[str]:
    prefixes = {name.rpartition(".")[0] for name in present}
    for prefix in sorted(prefixes):
        for choice in choices:
            names = [f"{prefix}.{channel}" if prefix else channel for channel in choice]
            if all(name in present for name in names):
                return names
    if ("*",) in choices and len(present) == 1:
        return present
    wanted = " or ".join(", ".join(choice) for choice in choices if choice != ("*",))
    raise FormatError(f"{path}: no channels {wanted}; the file has {', '.join(present)}")


def _checked_header(path: Path) -> _Header:
    size = path.stat().st_size
    with path.open("rb") as file:
        try:
            header = _parse_header(path, file)
            if not header.tiled:
                _check_complete(path, file, header, size)
        except (struct.error, KeyError) as error:
            raise FormatError(
                f"{path}: cut off or damaged EXR file ({size} bytes); copy or export it again"
            ) from error
    return header


def _parse_header(path: Path, file: BinaryIO) -> _Header:
    magic, flags = struct.unpack("<4sI", file.read(8))
    if magic != MAGIC:
        raise FormatError(f"{path}: not an EXR file")
    if flags & (_DEEP | _MULTIPART):
        raise FormatError(f"{path}: deep or multi-part EXR; save a flat, single-part one")
    attributes = {}
    while name := _string(file):
        _string(file)  # the attribute's type follows from its name
        (length,) = struct.unpack("<I", file.read(4))
        if length > _MAX_ATTRIBUTE_BYTES:
            raise struct.error("attribute too long")
        attributes[name] = file.read(length)
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    if attributes["displayWindow"] != attributes["dataWindow"]:
        raise FormatError(
            f"{path}: data window {(x0, y0, x1, y1)} differs from the display window; "
            "save the whole picture, not a crop"
        )
    width, height = x1 - x0 + 1, y1 - y0 + 1
    if width < 1 or height < 1 or width * height > MAX_PIXELS:
        raise FormatError(
            f"{path}: claims {width} x {height} pixels; at most {MAX_PIXELS} are read"
        )
    return _Header(
        channels=_parse_channels(attributes["channels"]),
        width=width,
        height=height,
        compression=attributes["compression"][0] if attributes["compression"] else -1,
        tiled=bool(flags & _TILED),
    )


def _parse_channels(data: bytes) -> dict[str, tuple[int, int]]:
    """Sampling in x and y of each channel of a `chlist` attribute."""
    channels = {}
    at = 0
    while at < len(data) and data[at]:
        end = data.find(b"\0", at)
        if end < 0:
            raise struct.error("unterminated channel name")
        _, _, x_sampling, y_sampling = struct.unpack_from("<iiii", data, end + 1)
        channels[data[at:end].decode("utf-8", "replace")] = (x_sampling, y_sampling)
        at = end + 17
    return channels


def _check_complete(path: Path, file: BinaryIO, header: _Header, size: int) -> None:
    """Follow the table of chunk offsets to the last chunk: does the file reach its end?"""
    lines = _LINES_PER_CHUNK.get(header.compression, 1)
    count = -(-header.height // lines)
    offsets = struct.unpack(f"<{count}Q", file.read(8 * count))
    last = max(offsets)
    if min(offsets) == 0 or last + 8 > size:
        raise struct.error("chunk missing")
    file.seek(last)
    _, length = struct.unpack("<iI", file.read(8))
    if last + 8 + length > size:
        raise struct.error("last chunk cut off")


def _string(file: BinaryIO) -> str:
    letters = bytearray()
    while (letter := file.read(1)) != b"\0":
        if not letter or len(letters) > 255:
            raise struct.error("unterminated name")
        letters += letter
    return letters.decode("utf-8", "replace")


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
