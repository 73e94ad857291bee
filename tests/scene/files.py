"""Small scenes and picture files for the tests of scene input."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

SHARED = Path(__file__).resolve().parents[3] / "shared" / "scenes"

MANIFEST = """format = 1
name = "box"

[video]
color = "color.exr"
depth = "depth.exr"
"""
IDENTITY = "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]"
OBJECT = f"""
[[objects]]
name = "cube"
mesh = "cube.obj"
to_world = {IDENTITY}
"""
VIEW = """
[[views]]
name = "ahead"
size = [32, 24]
"""

LOW, HIGH = np.array([-2.0, -1.3, -3.0]), np.array([2.5, 1.4, 2.0])
"""Corners of the box room."""


def directions(width: int, height: int) -> NDArray[np.float64]:
    """(H, W, 3) directions of texel centres, written out from the scene format."""
    phi = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    theta = ((np.arange(height) + 0.5) / height * np.pi)[:, None]
    return np.stack(
        [
            np.sin(theta) * np.sin(phi),
            np.cos(theta) * np.ones_like(phi),
            -np.sin(theta) * np.cos(phi),
        ],
        axis=-1,
    )


def box_room(width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth (H, W) and normals (H, W, 3) of a box seen from inside."""
    w = directions(width, height)
    with np.errstate(divide="ignore"):
        distance = np.where(w > 0, HIGH / w, LOW / w)
    wall = distance.argmin(axis=-1)[..., None]
    normal = np.zeros_like(w)
    np.put_along_axis(normal, wall, -np.sign(np.take_along_axis(w, wall, -1)), -1)
    return distance.min(axis=-1), normal


def write_channels(path: Path, **channels: NDArray[Any]) -> None:
    """An EXR file with separate channels; `a__R` stands for layer a, channel R."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {name.replace("__", "."): np.ascontiguousarray(p) for name, p in channels.items()}
    OpenEXR.File(header, planes).write(str(path))


def write_rgb(path: Path, color: NDArray[Any]) -> None:
    write_channels(path, R=color[..., 0], G=color[..., 1], B=color[..., 2])


def write_png16_grey(path: Path, values: NDArray[np.uint16]) -> None:
    Image.fromarray(values).save(path, format="PNG")


def write_png16(path: Path, pixels: NDArray[np.uint16]) -> None:
    """A 16-bit PNG of one to four channels, without row filters."""
    height, width, channels = pixels.shape
    coded = b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)
    color_type = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    header = struct.pack(">IIBBBBB", width, height, 16, color_type, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(coded))
        + chunk(b"IEND", b"")
    )


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


CUBE = """v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 4 8 7 3
f 1 5 8 4
f 2 3 7 6
"""


def write_scene(folder: Path, manifest: str = MANIFEST + OBJECT + VIEW, width: int = 64) -> Path:
    """A box room with a cube of 2 m around the origin; the folder."""
    folder.mkdir(exist_ok=True)
    depth, _ = box_room(width, width // 2)
    write_rgb(folder / "color.exr", np.full((width // 2, width, 3), 0.5, np.float32))
    write_channels(folder / "depth.exr", Z=depth.astype(np.float32))
    (folder / "cube.obj").write_text(CUBE)
    (folder / "scene.toml").write_text(manifest)
    return folder


def snapshot(folder: Path) -> dict[Path, bytes]:
    """Contents of all files below a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
