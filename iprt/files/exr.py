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
from iprt.files.toml_text import printable
from iprt.files.untrusted import MAX_BYTES, decoding, require_picture_size

MAGIC = b"\x76\x2f\x31\x01"

_MAX_HEADER_BYTES = 2**24
_SAMPLE_BYTES = {0: 4, 1: 2, 2: 4}
"""Bytes by the type code of a channel: unsigned, half, float."""
_DEEP = 0x800
_MULTIPART = 0x1000
_TILED = 0x200
_LINES_PER_CHUNK = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}
"""Lines by the compression code: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB."""


@dataclass(frozen=True)
class _Header:
    channels: dict[str, tuple[int, int]]
    width: int
    height: int
    compression: int
    tile: tuple[int, int] | None
    """Width and height of the tiles of a file that has them, in one level."""


def read_exr(path: Path, choices: Sequence[tuple[str, ...]]) -> list[NDArray[np.generic]]:
    """Read the first of `choices` that the file holds.

    Parameters
    ----------
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
            raise FormatError(
                f"{path}: channel {printable(name)} is subsampled; save it at full resolution"
            )
    import OpenEXR

    with decoding(path, "damaged EXR file"):
        channels = OpenEXR.File(os.fspath(path), separate_channels=True).channels()
        planes = [np.asarray(channels[name].pixels) for name in names]
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
            wanted = [f"{prefix}.{channel}" if prefix else channel for channel in choice]
            if all(name in present for name in wanted):
                return wanted
    if ("*",) in choices and len(present) == 1:
        return present
    known = printable(", ".join(present))
    asked = " or ".join(", ".join(choice) for choice in choices if choice != ("*",))
    raise FormatError(f"{path}: no channels {asked}; the file has {known}")


def _checked_header(path: Path) -> _Header:
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        try:
            header = _parse_header(path, file)
            _check_complete(file, header, size)
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
        if file.tell() + length > _MAX_HEADER_BYTES:
            raise struct.error("header too long")
        attributes[name] = file.read(length)
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    if attributes["displayWindow"] != attributes["dataWindow"]:
        raise FormatError(
            f"{path}: data window {(x0, y0, x1, y1)} differs from the display window; "
            "save the whole picture, not a crop"
        )
    width, height = x1 - x0 + 1, y1 - y0 + 1
    require_picture_size(path, width, height)
    channels, texel_bytes = _parse_channels(attributes["channels"])
    # The library decodes all channels, whichever are asked for.
    if width * height * texel_bytes > MAX_BYTES:
        raise FormatError(
            f"{path}: claims {len(channels)} channels of {width} x {height} pixels; "
            f"at most {MAX_BYTES} bytes are read"
        )
    return _Header(
        channels=channels,
        width=width,
        height=height,
        compression=attributes["compression"][0] if attributes["compression"] else -1,
        tile=_parse_tile(path, attributes["tiles"]) if flags & _TILED else None,
    )


def _parse_tile(path: Path, data: bytes) -> tuple[int, int]:
    width, height, mode = struct.unpack("<IIB", data)
    if mode & 15:
        raise FormatError(f"{path}: has mipmaps; save one level")
    require_picture_size(path, width, height)
    return width, height


def _parse_channels(data: bytes) -> tuple[dict[str, tuple[int, int]], int]:
    """Sampling in x and y of each channel of a `chlist` attribute, and bytes per pixel."""
    channels = {}
    at = texel_bytes = 0
    while at < len(data) and data[at]:
        end = data.find(b"\0", at)
        if end < 0:
            raise struct.error("unterminated channel name")
        kind, _, x_sampling, y_sampling = struct.unpack_from("<iiii", data, end + 1)
        if min(x_sampling, y_sampling) < 1:
            raise struct.error("impossible sampling")
        texel_bytes += _SAMPLE_BYTES[kind]
        channels[data[at:end].decode("utf-8", "replace")] = (x_sampling, y_sampling)
        at = end + 17
    return channels, texel_bytes


def _check_complete(file: BinaryIO, header: _Header, size: int) -> None:
    """Follow the table of chunk offsets to the last chunk: does the file reach its end?"""
    if header.tile is None:
        count = -(-header.height // _LINES_PER_CHUNK.get(header.compression, 1))
        place = 4  # the first line
    else:
        count = -(-header.width // header.tile[0]) * -(-header.height // header.tile[1])
        place = 16  # column and row of the tile, and its level in both directions
    if file.tell() + 8 * count > size:
        raise struct.error("table of chunks cut off")
    offsets = np.frombuffer(file.read(8 * count), "<u8")
    last = int(offsets.max())
    if offsets.min() == 0 or last + place + 4 > size:
        raise struct.error("chunk missing")
    file.seek(last + place)
    (length,) = struct.unpack("<I", file.read(4))
    if last + place + 4 + length > size:
        raise struct.error("last chunk cut off")


def _string(file: BinaryIO) -> str:
    letters = bytearray()
    while (letter := file.read(1)) != b"\0":
        if not letter or len(letters) > 255:
            raise struct.error("unterminated name")
        letters += letter
    return letters.decode("utf-8", "replace")
