"""Picture files as cameras and stitchers write them, byte by byte where no library writes them."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

ORIENTATION = 0x0112
XMP = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
    'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" {}/>'
    "</rdf:RDF></x:xmpmeta>"
)


def gpano(size: tuple[int, int], at: tuple[int, int], full: tuple[int, int], more: str = "") -> str:
    """Return XMP that places a picture of a size in a full panorama."""
    values = {
        "CroppedAreaImageWidthPixels": size[0],
        "CroppedAreaImageHeightPixels": size[1],
        "CroppedAreaLeftPixels": at[0],
        "CroppedAreaTopPixels": at[1],
        "FullPanoWidthPixels": full[0],
        "FullPanoHeightPixels": full[1],
    }
    return XMP.format(" ".join(f'GPano:{key}="{value}"' for key, value in values.items()) + more)


def stored_as(seen: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Return a picture (H, W, ...) seen upright as a file of an EXIF orientation stores it.

    Pixel by pixel, by the standard's words on where the first row and column are seen.
    """
    turned = orientation >= 5
    height, width = seen.shape[1::-1] if turned else seen.shape[:2]
    stored = np.empty((height, width, *seen.shape[2:]), seen.dtype)
    for r in range(height):
        for c in range(width):
            stored[r, c] = seen[
                {
                    1: (r, c),
                    2: (r, width - 1 - c),
                    3: (height - 1 - r, width - 1 - c),
                    4: (height - 1 - r, c),
                    5: (c, r),
                    6: (c, height - 1 - r),
                    7: (width - 1 - c, height - 1 - r),
                    8: (width - 1 - c, r),
                }[orientation]
            ]
    return stored


def exif(orientation: int) -> Image.Exif:
    tags = Image.Exif()
    tags[ORIENTATION] = orientation
    return tags


def write_png(path: Path, pixels: NDArray[Any], xmp: str = "", **options: Any) -> None:
    """Write PNG of 8 bits in color, or 16 in grey, with XMP."""
    texts = PngInfo()
    if xmp:
        texts.add_itxt("XML:com.adobe.xmp", xmp)
    Image.fromarray(pixels).save(path, format="PNG", pnginfo=texts, **options)


def write_tiff(
    path: Path,
    pixels: NDArray[Any],
    *,
    packed: bool = False,
    order: str = "<",
    orientation: int = 1,
    photometric: int | None = None,
    xmp: str = "",
) -> None:
    """Write TIFF of any samples in one strip; `packed` is Deflate."""
    height, width = pixels.shape[:2]
    channels = pixels.shape[2] if pixels.ndim == 3 else 1
    data = pixels.astype(pixels.dtype.newbyteorder(order)).tobytes()
    data = zlib.compress(data) if packed else data
    kind = {"u": 1, "i": 2, "f": 3}[pixels.dtype.kind]
    shown = photometric if photometric is not None else 2 if channels >= 3 else 1
    tags: list[tuple[int, str, list[int]]] = [
        (256, "I", [width]),
        (257, "I", [height]),
        (258, "H", [8 * pixels.dtype.itemsize] * channels),
        (259, "H", [8 if packed else 1]),
        (262, "H", [shown]),
        (273, "I", [8]),
        (274, "H", [orientation]),
        (277, "H", [channels]),
        (278, "I", [height]),
        (279, "I", [len(data)]),
        (284, "H", [1]),
        *([(338, "H", [2])] if channels == 4 and shown == 2 else []),
        (339, "H", [kind] * channels),
        *([(700, "B", list(xmp.encode()))] if xmp else []),
    ]
    data += b"\0" * (len(data) % 2)
    end = 8 + len(data) + 2 + 12 * len(tags) + 4
    entries = beyond = b""
    for tag, code, values in tags:
        raw = struct.pack(f"{order}{len(values)}{code}", *values)
        if len(raw) > 4:
            raw, place = b"", (raw + b"\0" * (len(raw) % 2), end + len(beyond))
            beyond += place[0]
            raw = struct.pack(f"{order}I", place[1])
        entries += struct.pack(f"{order}HHI", tag, "?BAHI".index(code), len(values))
        entries += raw.ljust(4, b"\0")
    start = struct.pack(f"{order}2sHI", b"II" if order == "<" else b"MM", 42, 8 + len(data))
    count = struct.pack(f"{order}H", len(tags))
    path.write_bytes(start + data + count + entries + b"\0" * 4 + beyond)


def write_hdr(path: Path, rgbe: NDArray[np.uint8], *, runs: bool = True, order: str = "") -> None:
    """Write Radiance HDR of (H, W, 4) mantissas and exponents, run-length encoded as usual."""
    height, width = rgbe.shape[:2]
    size = order or f"-Y {height} +X {width}"
    data = b"#?RADIANCE\n# made for a test\nFORMAT=32-bit_rle_rgbe\n\n" + f"{size}\n".encode()
    for row in rgbe:
        if not runs:
            data += row.tobytes()
            continue
        data += bytes([2, 2, width >> 8, width & 255])
        for channel in row.T:
            for first in range(0, width, 100):
                part = channel[first : first + 100]
                is_run = (part == part[0]).all()
                data += bytes([128 + part.size, part[0]]) if is_run else bytes([part.size])
                data += b"" if is_run else part.tobytes()
    path.write_bytes(data)
