"""Picture files as cameras and stitchers write them, byte by byte where no library writes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tifffile
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
    """Write TIFF of any samples; `packed` is Deflate."""
    color = pixels.ndim == 3 and pixels.shape[2] >= 3
    tags = [(274, "H", 1, orientation, True)]
    tifffile.imwrite(
        path,
        pixels if color else pixels.reshape(pixels.shape[:2]),
        byteorder=order,
        compression="zlib" if packed else None,
        photometric=photometric or ("rgb" if color else "minisblack"),
        planarconfig="contig" if color else None,
        extrasamples=["unassalpha"] if color and pixels.shape[2] == 4 and not photometric else None,
        extratags=[*tags, (700, "B", len(xmp), xmp.encode(), True)] if xmp else tags,
        metadata=None,
        software=False,
    )


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
