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

Files = list[tuple[str, bytes, tuple[Reader, ...]]]
"""Names, contents, and who reads them."""
Target = Callable[[bytes], Files]


class Reading:
    """A folder in memory in which a target's files are written and read, again and again."""

    def __init__(self, target: str) -> None:
        memory = "/dev/shm" if os.path.isdir("/dev/shm") else None
        self._kept = tempfile.TemporaryDirectory(dir=memory)
        self.folder = Path(self._kept.name)
        self.target: Target = getattr(self, f"_{target}")
        if target == "scene":
            write_scene(self.folder, width=16)
        Image.new("RGB", (2, 2), (255, 0, 0)).save(self.folder / "t.png")

    def __call__(self, data: bytes) -> bool:
        """Read a file in every way that there is; whether any accepts it."""
        accepted = False
        for name, contents, readers in self.target(data):
            path = self.folder / name
            path.write_bytes(contents)
            for reader in readers:
                accepted |= _accepts(READERS[reader], path)
        return accepted

    def _pfm(self, data: bytes) -> Files:
        return [("a.pfm", data, ("depth",))]

    def _png(self, data: bytes) -> Files:
        return [("a.png", _checked(data), ("color", "depth"))]

    def _jpeg(self, data: bytes) -> Files:
        return [("a.jpg", data, ("color", "depth", "header"))]

    def _tiff(self, data: bytes) -> Files:
        return [("a.tif", data, ("color", "depth", "header"))]

    def _hdr(self, data: bytes) -> Files:
        return [("a.hdr", data, ("color",))]

    def _webp(self, data: bytes) -> Files:
        return [("a.webp", data, ("color", "depth", "header"))]

    def _avif(self, data: bytes) -> Files:
        return [("a.avif", data, ("color", "depth", "header"))]

    def _npy(self, data: bytes) -> Files:
        return [("a.npy", data, ("depth",))]

    def _exr(self, data: bytes) -> Files:
        return [("a.exr", data, ("color", "depth"))]

    def _ply(self, data: bytes) -> Files:
        return [("m.ply", data, ("mesh",))]

    def _obj(self, data: bytes) -> Files:
        mesh, _, materials = data.partition(PARTS)
        return [("m.mtl", materials, ()), ("m.obj", mesh, ("mesh",))]

    def _stl(self, data: bytes) -> Files:
        return [("m.stl", data, ("mesh",))]

    def _gltf(self, data: bytes) -> Files:
        return [("m.gltf", data, ("mesh",))]

    def _glb(self, data: bytes) -> Files:
        return [("m.glb", data, ("mesh",))]

    def _video(self, data: bytes) -> Files:
        return [("a.mkv", data, ("video",))]

    def _settings(self, data: bytes) -> Files:
        return [("my.toml", data, ("settings",))]

    def _scene(self, data: bytes) -> Files:
        return [("scene.toml", data, ("scene",))]


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
