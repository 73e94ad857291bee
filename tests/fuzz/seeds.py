"""Small right files of every format, and the nasty ones that are small, to start fuzzing from."""

from __future__ import annotations

import io
import struct
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR
import trimesh
from PIL import Image

from iprt.settings.overrides import resolved, settings_toml
from tests.files.test_gain_map import OF_MAP, attributes, grey, jpeg, with_pictures
from tests.files.writing import exif, gpano, write_hdr, write_tiff
from tests.footage.video.encoding import Track, grey16, plain, write_video
from tests.geometry.gltf_models import models, write_model
from tests.geometry.test_ies import written
from tests.scene import corpus
from tests.scene.files import CUBE, MANIFEST, OBJECT, VIEW, write_channels, write_png16
from tests.scene.nasty_meshes import BINARY, CORNERS, DATA, TEXTURED, glb, gltf, ply

PARTS = b"\n=====\n"
"""Between an OBJ file and its MTL file, which are fuzzed as one."""
LARGEST = 4096
COMPRESSIONS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA")
RNG = np.random.default_rng(5)


def right(target: str) -> list[bytes]:
    """Files that can be read."""
    with tempfile.TemporaryDirectory() as folder:
        return _MAKERS[target](Path(folder))


def nasty(target: str) -> list[bytes]:
    """Files that cannot."""
    with tempfile.TemporaryDirectory() as folder:
        files = corpus.write_corpus(Path(folder)).values()
        paths = [path for entry, path in files if _target_of(entry.file) == target]
        return [
            path.read_bytes() for path in paths if path.is_file() and path.stat().st_size <= LARGEST
        ]


def _target_of(file: str) -> str:
    name, _, suffix = file.rpartition(".")
    if suffix in ("mkv", "mp4", "avi", "y4m"):
        return "video"
    return {"toml": "scene" if name == "scene" else "settings", "jpg": "jpeg", "tif": "tiff"}.get(
        suffix, suffix
    )


def _pfm(_: Path) -> list[bytes]:
    values = np.arange(8, dtype="<f4")
    return [b"Pf\n4 2\n-1\n" + values.tobytes(), b"Pf 4 2 1.5 " + values.astype(">f4").tobytes()]


def _png(folder: Path) -> list[bytes]:
    made = []
    for mode in ("1", "L", "LA", "P", "RGB", "RGBA", "I;16"):
        stream = io.BytesIO()
        Image.new(mode, (5, 3)).save(stream, "PNG")
        made.append(stream.getvalue())
    for channels in (1, 2, 3, 4):
        pixels = RNG.integers(0, 65536, (5, 3, channels), dtype=np.uint16)
        write_png16(folder / "a.png", pixels)
        made.append((folder / "a.png").read_bytes())
    return made


def _jpeg(_: Path) -> list[bytes]:
    made = []
    image = Image.fromarray(RNG.integers(0, 256, (8, 16, 3), np.uint8))
    for options in ({}, {"progressive": True}, {"subsampling": 0}):
        for mode in ("L", "RGB", "CMYK"):
            stream = io.BytesIO()
            image.convert(mode).save(stream, "JPEG", quality=50, **options)
            made.append(stream.getvalue())
    gain = attributes(OF_MAP)
    made.append(with_pictures(jpeg(grey(90), gain, exif=exif(6)), jpeg(grey(9), gain)))
    return made


def _tiff(folder: Path) -> list[bytes]:
    made = []
    for kind in ("u1", "u2", "u4", "f4"):
        for channels in (1, 3, 4):
            if kind == "u4" and channels > 1:
                continue
            pixels = RNG.integers(0, 200, (5, 9, channels)).astype(kind)
            for packed, order in ((False, "<"), (True, ">")):
                write_tiff(folder / "a.tif", pixels, packed=packed, order=order, orientation=6)
                made.append((folder / "a.tif").read_bytes())
    return made


def _hdr(folder: Path) -> list[bytes]:
    made = []
    for runs in (False, True):
        pixels = RNG.integers(100, 150, (5, 9, 4), dtype=np.uint8)
        write_hdr(folder / "a.hdr", pixels, runs=runs)
        made.append((folder / "a.hdr").read_bytes())
    return made


def _of_pillow(kind: str) -> list[bytes]:
    made = []
    image = Image.fromarray(RNG.integers(0, 256, (8, 16, 3), np.uint8))
    xmp = gpano((8, 4), (2, 2), (16, 8)).encode()
    for number in (1, 6):
        stream = io.BytesIO()
        image.save(stream, kind, quality=60, exif=exif(number), xmp=xmp)
        made.append(stream.getvalue())
    return made


def _npy(folder: Path) -> list[bytes]:
    made = []
    for kind in ("<f4", ">u2", "<f8"):
        for write in (np.save, np.savez, np.savez_compressed):
            stream = io.BytesIO()
            write(stream, np.ones((5, 9, 1), kind))
            made.append(stream.getvalue())
    return made


def _exr(folder: Path) -> list[bytes]:
    made = []
    plane = RNG.random((5, 9)).astype(np.float32)
    for name in COMPRESSIONS:
        for kind in (OpenEXR.scanlineimage, OpenEXR.tiledimage):
            header = {"compression": getattr(OpenEXR, f"{name}_COMPRESSION"), "type": kind}
            if kind == OpenEXR.tiledimage:
                header["tiles"] = OpenEXR.TileDescription()
            planes = {"R": plane, "G": plane.astype(np.float16), "B": plane.astype(np.uint32)}
            OpenEXR.File(header, planes).write(str(folder / "a.exr"))
            made.append((folder / "a.exr").read_bytes())
    write_channels(folder / "a.exr", left__Z=plane)
    return [*made, (folder / "a.exr").read_bytes()]


def _ply(_: Path) -> list[bytes]:
    solid = trimesh.creation.box()
    made = [solid.export(file_type="ply"), solid.export(file_type="ply", encoding="ascii")]
    solid.visual = trimesh.visual.TextureVisuals(uv=solid.vertices[:, :2])
    made.append(solid.export(file_type="ply", vertex_normal=True))
    quad = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0) + struct.pack(
        "<B4i", 4, 0, 1, 2, 3
    )
    made += [ply(4, 1, quad), ply(3, 1, CORNERS + struct.pack("<B3i", 3, 0, 1, 2), BINARY)]
    return [data if isinstance(data, bytes) else data.encode() for data in made]


def _obj(_: Path) -> list[bytes]:
    mtl = b"newmtl a\nKd 1 0.5 0\nKs 1 1 1\nNs 50\nd 0.5\nmap_Kd t.png\n"
    mtl += b"newmtl b\nmap_Kd -s 1 1 1 t.png\n"
    faces = "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nusemtl a\nf 1/1/1 2/2/1 3/3/1\nusemtl b\nf 1 2 3 4\n"
    text = f"mtllib m.mtl\n{CUBE}{faces}f -1//-1 -2//-1 -3//-1\nl 1 2\n".encode()
    return [CUBE.encode() + PARTS, text + PARTS + mtl]


def _stl(_: Path) -> list[bytes]:
    solid = trimesh.creation.box()
    return [solid.export(file_type="stl"), solid.export(file_type="stl_ascii").encode()]


def _gltf(_: Path) -> list[bytes]:
    return [gltf({}).encode(), gltf({**TEXTURED, "images": [{"uri": "t.png"}]}).encode()]


def _glb(folder: Path) -> list[bytes]:
    made = [glb(gltf({"buffers.0.uri": None}), DATA)]
    made.append(trimesh.creation.box().export(file_type="glb"))
    made += [write_model(folder / "m.glb", material).read_bytes() for _, material in models()]
    return made


def _ies(folder: Path) -> list[bytes]:
    made = []
    for last in (0, 90, 180, 360):
        turn = np.arange(0, last + 1, 45)
        values = np.tile([3.0, 2.0, 0.5], (len(turn), 1))
        made.append(written(folder / "a.ies", [0, 45, 90], turn, values).read_bytes())
    return made


def _scene(_: Path) -> list[bytes]:
    plane = "plane = { point = [0, 0, 0], normal = [0, 1, 0] }"
    real = f'[[real_materials]]\nname = "f"\nkind = "plastic"\ncolor = [1, 1, 0]\n{plane}\n'
    view = VIEW + 'cuts = [[0, 0, 4, 4]]\nobjects = ["cube"]\n'
    solid = OBJECT + 'material = { kind = "plastic", albedo = [0.1, 0.2, 0.3], alpha = 0.1 }\n'
    return [(MANIFEST + solid + real + view).encode()]


def _settings(_: Path) -> list[bytes]:
    return [settings_toml(resolved("balanced"), "all").encode(), b"[trace]\nrays = 4\n"]


def _video(folder: Path) -> list[bytes]:
    made = []
    codes = [RNG.integers(0, 65536, (8, 16)) for _ in range(2)]
    for file, track in (
        ("a.mkv", grey16(codes)),
        ("a.avi", Track("mjpeg", "yuvj420p", [plain(90, 32, 16)] * 2)),
        ("a.mp4", Track("libx264", "yuv420p", [plain(50 + 9 * i, 32, 16) for i in range(3)])),
        ("a.mov", Track("prores_ks", "yuv422p10le", [_deep(32, 16)])),
    ):
        made.append(write_video(folder / file, track).read_bytes())
    return made


def _deep(width: int, height: int) -> list[np.ndarray]:
    """Planes of yuv422p10le."""
    return [np.full((height, w), 512, "<u2") for w in (width, width // 2, width // 2)]


_MAKERS = {
    "pfm": _pfm,
    "png": _png,
    "jpeg": _jpeg,
    "tiff": _tiff,
    "hdr": _hdr,
    "webp": lambda _: _of_pillow("WEBP"),
    "avif": lambda _: _of_pillow("AVIF"),
    "npy": _npy,
    "exr": _exr,
    "ply": _ply,
    "obj": _obj,
    "stl": _stl,
    "gltf": _gltf,
    "glb": _glb,
    "ies": _ies,
    "scene": _scene,
    "settings": _settings,
    "video": _video,
}
TARGETS = tuple(_MAKERS)
