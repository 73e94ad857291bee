"""PNG with 16 bits per channel in colour, which Pillow reduces to 8 bits.

PNG specification, third edition (W3C), sections 5 (chunks) and 9 (filters).
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.untrusted import read_bytes, require_picture_size

_CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}
"""By the colour type: grey, RGB, grey and alpha, RGB and alpha."""


def read_png16(path: Path) -> NDArray[np.uint16]:
    """Read a 16-bit PNG exactly; (H, W, channels) uint16.

    Raises
    ------
    FormatError
        Not 16 bits per channel, interlaced, cut off or damaged.
    """
    try:
        chunks = _chunks(read_bytes(path))
        kind, header = chunks[0]
        if kind != b"IHDR":
            raise ValueError("no header first")
        width, height, bits, color_type, _, _, interlace = struct.unpack(">IIBBBBB", header)
        require_picture_size(path, width, height)
        if bits != 16 or color_type not in _CHANNELS:
            raise FormatError(f"{path}: not a 16-bit PNG")
        if interlace:
            raise FormatError(f"{path}: interlaced 16-bit PNG; save it without interlacing")
        bytes_per_pixel = 2 * _CHANNELS[color_type]
        expected = height * (1 + width * bytes_per_pixel)
        packed = b"".join(data for kind, data in chunks if kind == b"IDAT")
        raw = zlib.decompressobj().decompress(packed, expected)
        if len(raw) != expected:
            raise ValueError("too few pixels")
        rows = np.frombuffer(raw, np.uint8).reshape(height, -1)
        pixels = _unfilter(rows[:, 1:].reshape(height, width, bytes_per_pixel), rows[:, 0])
    except (struct.error, zlib.error, ValueError, IndexError) as error:
        raise FormatError(f"{path}: cut off or damaged PNG file ({error})") from error
    return pixels.view(">u2").astype(np.uint16)


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    chunks = []
    at = 8
    while True:
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + length]
        (checksum,) = struct.unpack_from(">I", data, at + 8 + length)
        if zlib.crc32(kind + body) != checksum:
            raise ValueError("checksum mismatch")
        chunks.append((kind, body))
        if kind == b"IEND":
            return chunks
        at += 12 + length


def _unfilter(coded: NDArray[np.uint8], filters: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Undo the row filters, one anti-diagonal at a time.

    A byte depends on its neighbours to the left, above, and above left, so that all pixels of an
    anti-diagonal are independent of each other.

    Parameters
    ----------
    coded : (H, W, bytes per pixel) uint8
    filters : (H,) uint8
        Filter type of each row, 0 to 4.
    """
    if filters.max(initial=0) > 4:
        raise ValueError("unknown filter")
    height, width, size = coded.shape
    row = width + 1
    pixels = np.zeros(((height + 1) * row, size), np.int16)
    coded_flat = coded.reshape(-1, size)
    kinds = filters.astype(np.intp)[:, None]
    for diagonal in range(width + height - 1):
        first, last = max(0, diagonal - width + 1), min(diagonal, height - 1)
        count = last - first + 1
        # One row down and one pixel left is a step of row - 1 in `pixels`, width - 1 in `coded`.
        at = (first + 1) * row + (diagonal - first) + 1
        step = row - 1
        end = at + (count - 1) * step + 1
        left = pixels[at - 1 : end - 1 : step]
        above = pixels[at - row : end - row : step]
        corner = pixels[at - row - 1 : end - row - 1 : step]
        to_left, to_above = np.abs(above - corner), np.abs(left - corner)
        to_corner = np.abs(left + above - 2 * corner)
        paeth = np.where(
            (to_left <= to_above) & (to_left <= to_corner),
            left,
            np.where(to_above <= to_corner, above, corner),
        )
        zero = np.zeros_like(left)
        predicted = np.choose(
            kinds[first : last + 1], [zero, left, above, (left + above) >> 1, paeth]
        )
        start = first * width + diagonal - first
        code_step = max(width - 1, 1)
        code = coded_flat[start : start + (count - 1) * code_step + 1 : code_step]
        pixels[at:end:step] = (code + predicted) & 255
    return pixels.reshape(height + 1, row, size)[1:, 1:].astype(np.uint8)
