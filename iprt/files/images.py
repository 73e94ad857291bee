"""Pictures on disk to arrays: EXR, PNG, JPEG and PFM, recognised by their first bytes."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iprt.errors import FormatError
from iprt.files import exr
from iprt.files.exr_header import MAGIC as EXR_MAGIC
from iprt.files.pfm import read_pfm
from iprt.files.untrusted import (
    MAX_PIXELS,
    decoding,
    open_file,
    read_bytes,
    require_picture_size,
)

Image2D = NDArray[np.float32]
_SIGNATURES = {
    EXR_MAGIC: "exr",
    b"\x89PNG": "png",
    b"\xff\xd8\xff": "jpeg",
    b"Pf": "pfm",
    b"PF": "pfm",
}
FLOAT_KINDS = ("exr", "pfm")
"""Kinds of files whose values have no upper end."""
TEXTURE_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF")
"""Names that Pillow has for what textures of meshes may be stored as."""
LOOKUP_ROWS = 128
"""Rows of a picture that are looked up in a table at once: NumPy makes indices of eight bytes."""
MAX_SCANS = 100
"""A progressive JPEG has no more; each goes over the whole picture. Programs write about ten."""
_START_OF_SCAN = b"\xff\xda"


def file_kind(path: Path) -> str:
    """ "exr", "png", "jpeg" or "pfm", by the file's first bytes.

    Raises
    ------
    FormatError
        Missing, unreadable, empty, or none of these.
    """
    with open_file(path) as file:
        start = file.read(4)
    for signature, kind in _SIGNATURES.items():
        if start.startswith(signature):
            return kind
    what = "empty" if not start else "not an EXR, PNG, JPEG or PFM file"
    raise FormatError(f"{path}: {what}")


def read_color(path: Path, layer: str | None = None) -> Image2D:
    """Read linear Rec.709 radiance as (H, W, 3) float32, as stored: possibly not finite.

    EXR is linear, and what it says of its primaries is converted; PNG and JPEG, 8 or 16 bits per
    channel, are decoded from sRGB. Alpha and colour profiles are ignored.

    Parameters
    ----------
    layer : str or None
        Layer of an EXR file. Default: the one that is the picture by its name.

    Raises
    ------
    FormatError
        Damaged, of another kind, without such a layer, or with several that could be meant.
    """
    kind = _kind_with(path, "color", layer)
    if kind == "exr":
        return exr.read_exr_color(path, layer)
    if kind == "pfm":
        raise FormatError(f"{path}: PFM is read as depth only; save colour as EXR, PNG or JPEG")
    image = _open_pillow(path)
    is_16_bit = kind == "png" and _is_16_bit(image)
    coded = _decoded(path, image, "RGB")
    return decode_srgb(_png16(path) if is_16_bit else coded)


def read_depth(path: Path, layer: str | None = None) -> tuple[Image2D, int]:
    """Read depth in stored units as (H, W) float32, and the bits of its integers; 0 for floats.

    EXR, PFM, and PNG or JPEG in grey: one channel, or three that are equal.

    Parameters
    ----------
    layer : str or None
        Layer of an EXR file. Default: the one that is depth by its name, or the only one.

    Raises
    ------
    FormatError
        As `read_color`; also pictures in colours.
    """
    kind = _kind_with(path, "depth", layer)
    if kind == "exr":
        plane = exr.read_exr_depth(path, layer)
        return plane.astype(np.float32, copy=False), 32 if plane.dtype.kind == "u" else 0
    if kind == "pfm":
        return read_pfm(path), 0
    image = _open_pillow(path)
    if image.mode.startswith("I"):
        return _decoded(path, image).astype(np.float32), 16
    is_16_bit = kind == "png" and _is_16_bit(image)
    coded = _decoded(path, image, None if image.mode == "L" else "RGB")
    coded = _png16(path) if is_16_bit else coded
    if coded.ndim == 3:
        if (coded != coded[..., :1]).any():
            raise FormatError(f"{path}: a picture in colours; {exr.NO_DEPTH}")
        coded = coded[..., 0]
    return coded.astype(np.float32), 16 if is_16_bit else 8


def read_normal(path: Path) -> Image2D:
    """Read world-space normals (H, W, 3) float32 from an EXR picture: x, y, z, as stored.

    Raises
    ------
    FormatError
        As `read_color`.
    """
    if file_kind(path) != "exr":
        raise FormatError(f"{path}: normals are read from EXR only")
    return exr.read_exr_normal(path)


def picture_size(path: Path, layer: str | None = None) -> tuple[int, int]:
    """Return width and height of an EXR, PNG or JPEG picture, from its header.

    Parameters
    ----------
    layer : str or None
        As of `read_color`.

    Raises
    ------
    FormatError
    """
    if file_kind(path) == "exr":
        return exr.exr_size(path, layer)
    image = _open_pillow(path)
    return image.width, image.height


def _kind_with(path: Path, key: str, layer: str | None) -> str:
    """Return the kind of a file; raise FormatError if it has no layers, but one is named."""
    kind = file_kind(path)
    if layer is not None and kind != "exr":
        raise FormatError(
            f"{path}: --{key}-layer ({key}_layer in scene.toml) is for EXR files; this one has no "
            "layers"
        )
    return kind


def decode_srgb(coded: NDArray[Any]) -> Image2D:
    """Linear float32 in [0, 1] of uint8 or uint16 sRGB values (IEC 61966-2-1)."""
    steps = np.iinfo(coded.dtype).max
    value = np.arange(steps + 1, dtype=np.float64) / steps
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    table, decoded = linear.astype(np.float32), np.empty(coded.shape, np.float32)
    for row in range(0, len(coded), LOOKUP_ROWS):
        rows = slice(row, row + LOOKUP_ROWS)
        # All are in the table. By the default mode, NumPy would fill a copy first.
        np.take(table, coded[rows], out=decoded[rows], mode="clip")
    return decoded


def _is_16_bit(image: Image.Image) -> bool:
    # Pillow reports mode RGB for 16-bit colour; the decoder's raw mode tells.
    tiles = getattr(image, "tile", [])
    return image.mode.startswith("I") or (bool(tiles) and "16" in str(tiles[0][3]))


def _png16(path: Path) -> NDArray[np.uint16]:
    """(H, W, 3) of a PNG with 16 bits per channel, of which Pillow keeps 8 in colour.

    FFmpeg unpacks texts of any size: Pillow has to have read the file before, which does not.
    """
    import av

    with decoding(path, "cut off or damaged picture"):
        codec = av.CodecContext.create("png", "r")
        codec.options = {"err_detect": "crccheck+explode", "max_pixels": str(MAX_PIXELS)}
        (frame,) = codec.decode(av.Packet(read_bytes(path)))
        channels = len(frame.format.components)
        rows = np.frombuffer(memoryview(frame.planes[0]), ">u2").reshape(frame.height, -1)
    chosen = range(3) if channels >= 3 else [0, 0, 0]
    columns = [rows[:, channel : frame.width * channels : channels] for channel in chosen]
    return np.stack(columns, axis=-1).astype(np.uint16)


def _open_pillow(path: Path) -> Image.Image:
    return open_picture(path, path, ("PNG", "JPEG"))


def open_picture(
    source: Path | BytesIO, path: Path, formats: Sequence[str] = TEXTURE_FORMATS
) -> Image.Image:
    """Open lazily: only the header is read, and its size checked; `path` names it in errors.

    Raises
    ------
    FormatError
        Damaged, of none of Pillow's `formats`, or larger than is read.
    """
    # Without a list of formats, Pillow runs Ghostscript on what looks like PostScript.
    with _quiet(), decoding(path, "cannot be read as a picture"):
        image = Image.open(source, formats=list(formats))
    require_picture_size(path, image.width, image.height)
    if image.format in ("JPEG", "MPO"):
        data = read_bytes(source) if isinstance(source, Path) else source.getvalue()
        if data.count(_START_OF_SCAN) > MAX_SCANS:
            raise FormatError(
                f"{path}: a progressive JPEG of more than {MAX_SCANS} scans; save it again"
                " without them"
            )
    return image


def texture_pixels(image: Image.Image, path: Path) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB of a picture that a mesh's loader has opened; `path` names it in errors.

    Raises
    ------
    FormatError
    """
    # MPO is JPEG with further pictures behind; without a format, the loader made it in memory.
    if image.format not in (*TEXTURE_FORMATS, "MPO", None):
        raise FormatError(f"{path}: a texture is no {', '.join(TEXTURE_FORMATS)} picture")
    require_picture_size(path, image.width, image.height)
    return _decoded(path, image, "RGB").astype(np.uint8, copy=False)


def _decoded(path: Path, image: Image.Image, mode: str | None = None) -> NDArray[Any]:
    """The pixels of a picture, converted to one of Pillow's modes."""
    with _quiet(), decoding(path, "cut off or damaged picture"):
        return np.asarray(image if mode in (None, image.mode) else image.convert(mode))


@contextmanager
def _quiet() -> Iterator[None]:
    """Sizes are checked here, so that Pillow need not warn of them, nor of odd palettes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
