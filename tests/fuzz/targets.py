"""One function per file format: read what the fuzzer makes; only errors for the user may come."""

from __future__ import annotations

import os
import struct
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from iprt.errors import IprtError
from tests.fuzz.seeds import PARTS
from tests.scene.corpus import READERS
from tests.scene.files import write_scene
from tests.scene.nasty import Reader

_PICTURE: tuple[Reader, ...] = ("color", "depth", "header")
_FILES: dict[str, tuple[str, tuple[Reader, ...]]] = {
    "pfm": ("a.pfm", ("depth",)),
    "png": ("a.png", ("color", "depth")),
    "jpeg": ("a.jpg", _PICTURE),
    "tiff": ("a.tif", _PICTURE),
    "hdr": ("a.hdr", ("color",)),
    "webp": ("a.webp", _PICTURE),
    "avif": ("a.avif", _PICTURE),
    "npy": ("a.npy", ("depth",)),
    "exr": ("a.exr", ("color", "depth")),
    "ply": ("m.ply", ("mesh",)),
    "obj": ("m.obj", ("mesh",)),
    "stl": ("m.stl", ("mesh",)),
    "gltf": ("m.gltf", ("mesh",)),
    "glb": ("m.glb", ("mesh",)),
    "ies": ("a.ies", ("ies",)),
    "video": ("a.mkv", ("video",)),
    "settings": ("my.toml", ("settings",)),
    "scene": ("scene.toml", ("scene",)),
}
"""By target: the file's name, and who reads it."""


class Reading:
    """A folder in memory in which a target's files are written and read, again and again."""

    def __init__(self, target: str) -> None:
        memory = "/dev/shm" if os.path.isdir("/dev/shm") else None
        self._kept = tempfile.TemporaryDirectory(dir=memory)
        self.folder = Path(self._kept.name)
        self.name, self.readers = _FILES[target]
        if target == "scene":
            write_scene(self.folder, width=16)
        Image.new("RGB", (2, 2), (255, 0, 0)).save(self.folder / "t.png")

    def __call__(self, data: bytes) -> bool:
        """Read a file in every way that there is; whether any accepts it."""
        if self.name == "a.png":
            data = _checked(data)
        if self.name == "m.obj":
            data, _, materials = data.partition(PARTS)
            (self.folder / "m.mtl").write_bytes(materials)
        path = self.folder / self.name
        path.write_bytes(data)
        accepted = [_accepts(READERS[reader], path) for reader in self.readers]
        return any(accepted)


def _accepts(reader: Callable[[Path], object], path: Path) -> bool:
    try:
        reader(path)
    except IprtError as error:
        text = str(error)
    else:
        return True
    first, *more = text.splitlines()
    assert all(line.startswith("  ") for line in more), text
    assert not more or "problems" in first, text
    return False


def _checked(data: bytes) -> bytes:
    """A PNG with the checksums that its chunks ought to have, so that mutants are looked into."""
    made, at = data[:8], 8
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        body = data[at + 4 : at + 8 + length]
        made += data[at : at + 4] + body + struct.pack(">I", zlib.crc32(body))
        at += 12 + length
    return made
