"""Headers of OpenEXR files, checked before the library allocates the declared sizes.

The check also avoids the library's messages about cut-off files on stdout. Layout: "OpenEXR File
Layout", https://openexr.com/en/latest/OpenEXRFileLayout.html.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from iprt.errors import FormatError
from iprt.files.safe_reading import MAX_BYTES, open_file, require_picture_size

MAGIC = b"\x76\x2f\x31\x01"

_MAX_HEADER_BYTES = 2**24
_SAMPLE_BYTES = {0: 4, 1: 2, 2: 4}
"""Bytes by the type code of a channel: unsigned, half, float."""
_DEEP = 0x800
_MULTIPART = 0x1000
_TILED = 0x200
_COMPRESSIONS = {
    0: ("none", 1),
    1: ("RLE", 1),
    2: ("ZIPS", 1),
    3: ("ZIP", 16),
    4: ("PIZ", 32),
    5: ("PXR24", 16),
    6: ("B44", 32),
    7: ("B44A", 32),
    8: ("DWAA", 32),
    9: ("DWAB", 256),
    10: ("HTJ2K256", 256),
    11: ("HTJ2K32", 32),
    12: ("LJ2K", 256),
    13: ("ZSTD", 1),
}
"""Name and lines per chunk by the compression code."""

_Attributes = dict[str, bytes]


@dataclass(frozen=True)
class Part:
    """One part of an EXR file, as described by its header.

    Attributes
    ----------
    name : str
        Empty in a file of one part.
    channels : dict of str to (int, int)
        Sampling in x and y by the channel's full name.
    window : (int, int, int, int)
        First and last column and row of the pixels: x0, y0, x1, y1.
    is_whole : bool
        True if the pixels fill the display window.
    compression : int
        Compression code of the file format.
    tile : (int, int) or None
        Width and height of tiles, in one level; None for scan lines.
    chromaticities : bytes or None
        The attribute's value as stored.
    """

    name: str
    channels: dict[str, tuple[int, int]]
    window: tuple[int, int, int, int]
    is_whole: bool
    compression: int
    tile: tuple[int, int] | None
    chromaticities: bytes | None

    @property
    def width(self) -> int:
        """Width in pixels."""
        return self.window[2] - self.window[0] + 1

    @property
    def height(self) -> int:
        """Height in pixels."""
        return self.window[3] - self.window[1] + 1

    @property
    def compression_name(self) -> str:
        """Name of the compression."""
        return _COMPRESSIONS[self.compression][0]

    def chunk_count(self) -> int:
        """Return the number of chunks that the pixels are stored in."""
        if self.tile is None:
            return -(-self.height // _COMPRESSIONS[self.compression][1])
        return -(-self.width // self.tile[0]) * -(-self.height // self.tile[1])


def read_parts(path: Path) -> list[Part]:
    """Read the headers of all parts, and check that the file is complete.

    Raises
    ------
    FormatError
        The file is cut off, damaged, deep, mipmapped, too large, or of unknown compression.
    """
    with open_file(path) as file:
        size = os.fstat(file.fileno()).st_size
        try:
            magic, flags = struct.unpack("<4sI", file.read(8))
            if magic != MAGIC:
                raise FormatError(f"{path}: not an EXR file")
            several = bool(flags & _MULTIPART)
            headers = _headers(path, file, flags)
            parts = [_part(path, header, flags) for header in headers]
            _require_bytes(path, parts, headers)
            for part, header in zip(parts, headers, strict=True):
                # The library takes the length of a part's table of chunks from its header.
                if several and struct.unpack("<i", header["chunkCount"])[0] != part.chunk_count():
                    raise struct.error("impossible number of chunks")
            for part in parts:
                _check_complete(file, part, size, several)
        except (struct.error, KeyError) as error:
            raise FormatError(
                f"{path}: cut off or damaged EXR file ({size} bytes); copy or export it again"
            ) from error
    return parts


def _headers(path: Path, file: BinaryIO, flags: int) -> list[_Attributes]:
    """Read the attributes of each part; an empty header ends a multi-part list."""
    if flags & _DEEP:
        raise FormatError(f"{path}: deep EXR; save a flat one")
    headers = [_attributes(file)]
    while flags & _MULTIPART and (further := _attributes(file)):
        headers.append(further)
    if any(header.get("type", b"").startswith(b"deep") for header in headers):
        raise FormatError(f"{path}: deep EXR; save a flat one")
    return headers


def _attributes(file: BinaryIO) -> _Attributes:
    attributes = {}
    while name := _string(file):
        _string(file)  # the attribute's type follows from its name
        (length,) = struct.unpack("<I", file.read(4))
        if file.tell() + length > _MAX_HEADER_BYTES:
            raise struct.error("header too long")
        attributes[name] = file.read(length)
    return attributes


def _part(path: Path, attributes: _Attributes, flags: int) -> Part:
    several = bool(flags & _MULTIPART)
    window = struct.unpack("<4i", attributes["dataWindow"])
    require_picture_size(path, window[2] - window[0] + 1, window[3] - window[1] + 1)
    compression = attributes["compression"][0] if attributes["compression"] else -1
    if compression not in _COMPRESSIONS:
        raise FormatError(f"{path}: compression {compression} is not known; save it with ZIP")
    tiled = attributes["type"] == b"tiledimage" if several else bool(flags & _TILED)
    return Part(
        name=attributes["name"].decode("utf-8", "replace") if several else "",
        channels={name: (x, y) for name, (_, x, y) in _channels(attributes).items()},
        window=window,
        is_whole=attributes["displayWindow"] == attributes["dataWindow"],
        compression=compression,
        tile=_tile(path, attributes["tiles"]) if tiled else None,
        chromaticities=attributes.get("chromaticities"),
    )


def _require_bytes(path: Path, parts: list[Part], headers: list[_Attributes]) -> None:
    """Raise FormatError if the declared channels, all decoded by the library, are too large."""
    needed = channels = 0
    for part, header in zip(parts, headers, strict=True):
        texel = sum(_SAMPLE_BYTES[kind] for kind, _, _ in _channels(header).values())
        needed += part.width * part.height * texel
        channels += len(part.channels)
    if needed > MAX_BYTES:
        size = f"{parts[0].width} x {parts[0].height}"
        raise FormatError(
            f"{path}: claims {channels} channels of {size} pixels; at most {MAX_BYTES} bytes "
            "are read"
        )


def _tile(path: Path, data: bytes) -> tuple[int, int]:
    width, height, mode = struct.unpack("<IIB", data)
    if mode & 15:
        raise FormatError(f"{path}: has mipmaps; save one level")
    require_picture_size(path, width, height)
    return width, height


def _channels(attributes: _Attributes) -> dict[str, tuple[int, int, int]]:
    """Return type code and sampling in x and y of each channel of a `chlist` attribute."""
    data, channels, at = attributes["channels"], {}, 0
    while at < len(data) and data[at]:
        end = data.find(b"\0", at)
        if end < 0:
            raise struct.error("unterminated channel name")
        kind, _, x_sampling, y_sampling = struct.unpack_from("<iiii", data, end + 1)
        if min(x_sampling, y_sampling) < 1 or kind not in _SAMPLE_BYTES:
            raise struct.error("impossible channel")
        channels[data[at:end].decode("utf-8", "replace")] = kind, x_sampling, y_sampling
        at = end + 17
    return channels


def _check_complete(file: BinaryIO, part: Part, size: int, several: bool) -> None:
    """Check that the file holds the last chunk of the next table of chunk offsets."""
    # Chunk header: the first line, or the tile's column, row and two levels.
    place = 4 if part.tile is None else 16
    if several:
        place += 4  # the number of the part
    count = part.chunk_count()
    if file.tell() + 8 * count > size:
        raise struct.error("table of chunks cut off")
    offsets = np.frombuffer(file.read(8 * count), "<u8")
    after, last = file.tell(), int(offsets.max())
    if offsets.min() == 0 or last + place + 4 > size:
        raise struct.error("chunk missing")
    file.seek(last + place)
    (length,) = struct.unpack("<I", file.read(4))
    if last + place + 4 + length > size:
        raise struct.error("last chunk cut off")
    file.seek(after)


def _string(file: BinaryIO) -> str:
    letters = bytearray()
    while (letter := file.read(1)) != b"\0":
        if not letter or len(letters) > 255:
            raise struct.error("unterminated name")
        letters += letter
    return letters.decode("utf-8", "replace")
