"""Tags of TIFF pictures."""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from operator import add
from pathlib import Path
from warnings import catch_warnings, simplefilter

from PIL import TiffImagePlugin

from iprt.errors import FormatError
from iprt.files.orientation import TAG as ORIENTATION
from iprt.files.orientation import valid_orientation
from iprt.files.safe_reading import decoding, open_file, read_bytes, require_picture_size

_WIDTH, _HEIGHT, _BITS, _CHANNELS, _FORMAT = 256, 257, 258, 277, 339
_PHOTOMETRIC, _GREY, _RGB = 262, 1, 2
_XMP = 700
_UNSIGNED, _FLOAT = 1, 3
_OF_PIXELS = (*range(256, 260), 262, 266, 273, 277, 278, 279, 284, 317, *range(322, 326))
"""Tags needed to decode the pixels."""
_PIECES = ((273, 279), (324, 325))
"""Tags with the offsets and the bytes of strips, and of tiles."""
_ENTRY = 12
"""Bytes of a tag."""


@dataclass(frozen=True)
class TiffTags:
    """The tags in the first directory of a TIFF file.

    Attributes
    ----------
    width, height : int
        Stored size.
    bits, channels : int
    is_float : bool
    orientation : int
        EXIF orientation.
    xmp : str
    """

    width: int
    height: int
    bits: int
    channels: int
    is_float: bool
    orientation: int
    xmp: str

    @property
    def is_deep(self) -> bool:
        """True if Pillow would lose bits, or could not read the picture."""
        return self.channels > 2 and self.bits > 8


def read_tags(path: Path) -> TiffTags:
    """Read the tags of a file.

    Raises
    ------
    FormatError
        The file is damaged or too large, or has unsupported samples.
    """
    with decoding(path, "damaged TIFF file"), open_file(path) as file, catch_warnings():
        simplefilter("ignore")  # Pillow warns about truncated files
        start = file.read(8)
        start += file.read(8) if b"+" in start[2:4] else b""  # BigTIFF
        tags = TiffImagePlugin.ImageFileDirectory_v2(start)
        file.seek(tags.next)
        tags.load(file)
        width, height = int(tags[_WIDTH]), int(tags[_HEIGHT])
        bits, formats = set(tags.get(_BITS, (1,))), set(tags.get(_FORMAT, (_UNSIGNED,)))
        channels, xmp = int(tags.get(_CHANNELS, 1)), tags.get(_XMP, b"")
        photometric = tags.get(_PHOTOMETRIC, _GREY)
        size = os.fstat(file.fileno()).st_size
        for offsets, counts in _PIECES:
            ends = map(add, tags.get(offsets, ()), tags.get(counts, ()))
            if max(ends, default=0) > size:
                raise FormatError(f"{path}: cut off TIFF file ({size} bytes)")
    require_picture_size(path, width, height)
    is_float = formats == {_FLOAT}
    known = bits == {32} if is_float else formats == {_UNSIGNED} and bits <= {1, 2, 4, 8, 16, 32}
    if len(bits) != 1 or not known or (channels > 2 and bits == {32} and not is_float):
        sizes = "/".join(str(size) for size in sorted(bits))
        what = "floats" if _FLOAT in formats else "signed integers" if 2 in formats else "integers"
        raise FormatError(
            f"{path}: a TIFF file of {sizes}-bit {what} in {channels} channels is not read; save "
            "it with 32-bit floats or 8 or 16-bit integers, or as EXR"
        )
    if max(bits) > 8 and photometric not in (_GREY, _RGB):
        raise FormatError(
            f"{path}: a TIFF file of {max(bits)} bits that is neither RGB nor grey is not read; "
            "save it as RGB"
        )
    return TiffTags(
        width,
        height,
        bits.pop(),
        channels,
        is_float,
        valid_orientation(tags.get(ORIENTATION)),
        xmp.decode("utf-8", "replace") if isinstance(xmp, bytes) else str(xmp),
    )


def with_tags_of_pixels(path: Path) -> bytes:
    """Return a file with only the tags of the pixels; FFmpeg takes any other for damage.

    Raises
    ------
    FormatError
        The file is damaged, or BigTIFF.
    """
    data = read_bytes(path)
    order = "<" if data.startswith(b"II") else ">"
    if b"+" in data[2:4]:
        raise FormatError(f"{path}: BigTIFF of such samples is not read; save it as TIFF, or EXR")
    with decoding(path, "damaged TIFF file"):
        (at,) = struct.unpack_from(f"{order}I", data, 4)
        (count,) = struct.unpack_from(f"{order}H", data, at)
        places = range(at + 2, at + 2 + count * _ENTRY, _ENTRY)
        entries = [
            data[place : place + _ENTRY]
            for place in places
            if struct.unpack_from(f"{order}H", data, place)[0] in _OF_PIXELS
        ]
    padding = len(data) % 2
    start = data[:4] + struct.pack(f"{order}I", len(data) + padding)
    directory = struct.pack(f"{order}H", len(entries)) + b"".join(entries) + bytes(4)
    return b"".join([start, memoryview(data)[8:], bytes(padding), directory])
