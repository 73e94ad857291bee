"""Files made to hurt whoever reads them, each with the error that it must give: pictures.

They are made when they are wanted, `tests/scene/corpus.py`; none is kept in the repository.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import OpenEXR
from PIL import Image

from tests.scene.files import chunk, write_channels

Reader = Literal[
    "color", "depth", "header", "ies", "mesh", "manifest", "scene", "settings", "video"
]
PNG = b"\x89PNG\r\n\x1a\n"
END = chunk(b"IEND", b"")


@dataclass(frozen=True)
class Nasty:
    """A file: who reads it, how it is made in a folder, and a part of the error."""

    name: str
    reader: Reader
    file: str
    write: Callable[[Path], object]
    message: str


CORPUS: list[Nasty] = []


def nasty(reader: Reader, file: str, name: str, data: bytes | str, message: str) -> None:
    content = data.encode() if isinstance(data, str) else data
    CORPUS.append(Nasty(name, reader, file, lambda path: path.write_bytes(content), message))


def nasty_script(reader: Reader, file: str, message: str) -> Callable[[Any], Any]:
    """A file that a function writes, given its path; the function's name is the file's."""

    def register(function: Callable[[Path], object]) -> Callable[[Path], object]:
        name = function.__name__.replace("_", " ")
        CORPUS.append(Nasty(name, reader, file, function, message))
        return function

    return register


nasty("depth", "d.pfm", "PFM of 40 GB", b"Pf\n100000 100000\n-1\n", "claims 100000 x 100000")
nasty("depth", "d.pfm", "PFM without its pixels", b"Pf\n16384 8192\n-1\n", "0 of 536870912 bytes")
nasty("depth", "d.pfm", "PFM of one line", b"Pf\n99999999 1\n-1\n", "at most 16384 a side")


def png(width: int, height: int, bits: int, data: bytes, *before: bytes) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, bits, 2, 0, 0, 0)
    return PNG + b"".join(before) + chunk(b"IHDR", header) + chunk(b"IDAT", data) + END


def compressed_zeros(mebibytes: int) -> bytes:
    """The zlib stream of that many zeros: one mebibyte's again and again, which takes no time."""
    stream = zlib.compressobj(9)
    one = stream.compress(bytes(2**20)) + stream.flush(zlib.Z_FULL_FLUSH)
    header, block, end = one[:2], one[2:], b"\x03\0"
    adler = (mebibytes * 2**20 % 65521) << 16 | 1
    return header + block * mebibytes + end + struct.pack(">I", adler)


ZEROS = compressed_zeros(16)
TOO_LARGE = "c.png: cannot be read as a picture (Image size"
TEXT = chunk(b"zTXt", b"a\0\0" + compressed_zeros(64))
LONG_TEXT = chunk(b"zTXt", b"a\0\0" + compressed_zeros(256))
SECOND = chunk(b"IHDR", struct.pack(">IIBBBBB", 9, 2, 16, 2, 0, 0, 0))
for _name, _data, _message in (
    *((f"of {b} bits, 10^10 pixels", png(10**5, 10**5, b, b"x"), "") for b in (8, 16)),
    *((f"of {b} bits, 2^28 pixels", png(2**14, 2**14, b, ZEROS), TOO_LARGE) for b in (8, 16)),
    *((f"of {b} bits, no pixels", png(0, 4, b, ZEROS), "c.png") for b in (8, 16)),
    *((f"of {b} bits, a long row", png(20000, 1, b, ZEROS), "a side") for b in (8, 16)),
    ("with two headers", png(4, 4, 16, ZEROS, SECOND), "c.png: "),
    ("with a bomb of text", png(4, 4, 8, b"x", TEXT), "c.png: "),
    (
        "with a bomb of text behind its pixels",
        png(4, 4, 16, ZEROS)[: -len(END)] + LONG_TEXT + END,
        "c.png: cut off or damaged picture (Decompressed data too large",
    ),
    ("with a chunk of 2 GB", PNG + b"\x7f\xff\xff\xffIHDR", "c.png: "),
    ("that is PostScript", b"\x89PNG%!PS-Adobe-3.0 EPSF", "c.png: "),
):
    nasty("color", "c.png", f"PNG {_name}", _data, _message)


@nasty_script("color", "c.jpg", "c.jpg: cannot be read as a picture (Image size")
def jpeg_of_4_gigapixels(path: Path) -> None:
    Image.new("RGB", (16, 8)).save(path)
    data = bytearray(path.read_bytes())
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = struct.pack(">HH", 65000, 65000)
    path.write_bytes(data)


@nasty_script("color", "c.jpg", "more than 100 scans")
def jpeg_of_5000_scans(path: Path) -> None:
    Image.new("RGB", (16, 8)).save(path, progressive=True)
    data = path.read_bytes()
    last = data.rindex(b"\xff\xda")
    path.write_bytes(data[:last] + data[last:-2] * 5000 + data[-2:])


def exr(path: Path, *changes: tuple[bytes, bytes], tiled: bool = False) -> None:
    """An EXR picture with bytes of its header replaced."""
    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION}
    header["type"] = OpenEXR.tiledimage if tiled else OpenEXR.scanlineimage
    if tiled:
        header["tiles"] = OpenEXR.TileDescription()
    OpenEXR.File(header, {"Z": np.ones((8, 16), np.float32)}).write(str(path))
    data = path.read_bytes()
    for old, new in changes:
        assert old in data
        data = data.replace(old, new)
    path.write_bytes(data)


WINDOW = struct.pack("<4i", 0, 0, 15, 7)
CHANNEL = b"Z\0" + struct.pack("<iiii", 2, 0, 1, 1)
TILES = b"tiledesc\0" + struct.pack("<I", 9)

for _name, _message, _old, _new in (
    ("EXR of 10^10 pixels", "claims", WINDOW, struct.pack("<4i", 0, 0, 99999, 99999)),
    ("EXR of all columns", "claims", WINDOW, struct.pack("<4i", -(2**31), 0, 2**31 - 1, 7)),
    ("EXR of no rows", "claims", WINDOW, struct.pack("<4i", 0, 0, 15, -8)),
    ("EXR of more rows", "cut off", WINDOW, struct.pack("<4i", 0, 0, 15, 9999)),
    ("EXR sampled at no pixel", "damaged", CHANNEL, CHANNEL[:-8] + bytes(8)),
    ("EXR of unknown samples", "damaged", CHANNEL, CHANNEL[:2] + b"\x09" + CHANNEL[3:]),
    (
        "EXR with a channel for each other pixel",
        "subsampled",
        CHANNEL,
        CHANNEL[:-8] + b"\2\0\0\0" * 2,
    ),
    ("EXR that is deep", "deep EXR", b"\2\0\0\0channels", b"\2\x08\0\0channels"),
    ("EXR of parts that it lacks", "cut off", b"\2\0\0\0channels", b"\2\x10\0\0channels"),
    ("EXR with an attribute of 4 GB", "damaged", b"box2i\0\x10\0\0\0", b"box2i\0\xff\xff\xff\xff"),
):
    CORPUS.append(
        Nasty(_name, "depth", "d.exr", lambda path, c=(_old, _new): exr(path, c), _message)
    )


@nasty_script("depth", "d.exr", "claims 4294967295 x 4294967295")
def exr_with_tiles_of_16_exabytes(path: Path) -> None:
    exr(path, tiled=True)
    data = path.read_bytes()
    at = data.index(TILES) + len(TILES)
    path.write_bytes(data[:at] + b"\xff" * 8 + data[at + 8 :])


@nasty_script("depth", "d.exr", "mipmaps")
def exr_with_mipmaps(path: Path) -> None:
    exr(path, tiled=True)
    data = path.read_bytes()
    at = data.index(TILES) + len(TILES) + 8
    path.write_bytes(data[:at] + b"\1" + data[at + 1 :])


@nasty_script("depth", "d.exr", "claims 2000 channels")
def exr_of_2000_channels(path: Path) -> None:
    write_channels(path, **{f"a{i}": np.ones((3, 5), np.float32) for i in range(2000)})
    data = path.read_bytes()
    path.write_bytes(
        data.replace(struct.pack("<4i", 0, 0, 4, 2), struct.pack("<4i", 0, 0, 8191, 4095))
    )


@nasty_script("color", "c.exr", "no channels R, G, B or Y; the file has A\\x1b[31m, Z\\nZ")
def exr_with_channels_that_write_on_the_terminal(path: Path) -> None:
    write_channels(path, **{name: np.ones((4, 8), np.float32) for name in ("Z\nZ", "A\x1b[31m")})
