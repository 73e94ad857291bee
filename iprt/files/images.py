"""Reading of pictures into arrays, upright by their EXIF orientation."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, features

from iprt.errors import FormatError
from iprt.files import exr
from iprt.files.deep_pictures import DAMAGED, decoded_by_ffmpeg, hdr_size
from iprt.files.gain_map import names_gain_map, read_gain_map
from iprt.files.kinds import file_kind, require_sdr
from iprt.files.numpy_depth import read_numpy
from iprt.files.orientation import TURNED, as_stored, orientation_of, upright
from iprt.files.pfm import read_pfm
from iprt.files.safe_reading import decoding, read_bytes, require_picture_size
from iprt.files.tiff import read_tags, with_tags_of_pixels
from iprt.files.xmp import xmp_of

Image2D = NDArray[np.float32]
_DEPTH_ONLY = {"pfm": "PFM", "npy": "NumPy's .npy", "npz": "NumPy's .npz"}
_PILLOW_FORMATS = {
    "png": "PNG",
    "jpeg": "JPEG",
    "webp": "WEBP",
    "avif": "AVIF",
    "heic": "HEIF",
    "tiff": "TIFF",
}
"""Pillow's names for the kinds of files that it reads."""
NO_GAIN_MAP = (
    "has a gain map that is not read: highlights are clipped at white; export it as EXR or HDR"
)
TEXTURE_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF")
"""Pillow's names for the formats of mesh textures."""
LOOKUP_ROWS = 128
"""Rows per table look-up, which bounds memory: NumPy makes indices of eight bytes."""
MAX_SCANS = 100
"""Limit for the scans of a progressive JPEG, each of which covers the whole picture. Programs write
about ten."""
_START_OF_SCAN = b"\xff\xda"


@dataclass(frozen=True)
class Header:
    """The header of a picture, read before its pixels are decoded.

    Attributes
    ----------
    width, height : int
        Upright size, as `read_color` returns the picture.
    has_end : bool
        True if values are limited to 1, so that light is clipped.
    xmp : str
        XMP text; see `gpano_crop`.
    unread : str
        Description of parts of the file that are not read; empty if none.
    orientation : int
        EXIF orientation that `read_color` applies to the stored pixels; see `upright`.
    """

    width: int
    height: int
    has_end: bool = True
    xmp: str = ""
    unread: str = ""
    orientation: int = 1

    @property
    def stored_size(self) -> tuple[int, int]:
        """Width and height of the stored pixels."""
        size = (self.width, self.height)
        return size[::-1] if self.orientation in TURNED else size


def read_color(path: Path, layer: str | None = None) -> Image2D:
    """Read linear Rec.709 radiance as (H, W, 3) float32; values may be non-finite.

    EXR, Radiance HDR and floating-point TIFF are linear, and an EXR file's primaries are converted.
    Integers of 8 or 16 bits are decoded from sRGB. A JPEG's gain map is applied. Alpha and color
    profiles are ignored.

    Parameters
    ----------
    layer : str or None
        Layer of an EXR file. Default: the layer named as the picture.

    Raises
    ------
    FormatError
        The file is damaged or of another kind, or the layer is missing or ambiguous.
    """
    kind = _kind_with(path, "color", layer)
    if kind == "exr":
        return exr.read_exr_color(path, layer)
    if kind in _DEPTH_ONLY:
        raise FormatError(
            f"{path}: {_DEPTH_ONLY[kind]} is read as depth only; save color as EXR, PNG or JPEG"
        )
    if kind == "hdr":
        hdr_size(path)
        color: Image2D = decoded_by_ffmpeg(path, "hdr", read_bytes(path))
        return color
    stored = _pixels(path, kind)
    if stored.dtype == np.uint32:
        raise FormatError(f"{path}: a TIFF file of 32-bit integers is read as depth only")
    color = stored if stored.dtype == np.float32 else decode_srgb(stored)
    if color.ndim == 2:
        color = np.repeat(color[..., None], 3, axis=-1)
    if kind == "jpeg":
        image = _open_pillow(path, kind)
        if names_gain_map(image) and (gain := read_gain_map(path)):
            gain.brighten(as_stored(color, orientation_of(image)))
    return np.ascontiguousarray(color)


def _pixels(path: Path, kind: str) -> NDArray[Any]:
    """Decode an upright picture, (H, W) or (H, W, 3): unsigned integers or float32 as stored."""
    if kind == "tiff":
        return _tiff_pixels(path)
    image = _open_pillow(path, kind)
    is_grey, is_16_bit = image.mode.startswith("I"), kind == "png" and _is_16_bit(image)
    stored = _decoded(path, image, None if is_grey else "RGB")
    if is_grey:
        stored = stored.astype(np.uint16, copy=False)
    elif is_16_bit:
        stored = decoded_by_ffmpeg(path, "png", read_bytes(path))
    return upright(stored, orientation_of(image))


def _tiff_pixels(path: Path) -> NDArray[Any]:
    tags = read_tags(path)
    if tags.is_deep:
        deep = decoded_by_ffmpeg(path, "tiff", with_tags_of_pixels(path))
        return upright(deep, tags.orientation)
    image = _open_pillow(path, "tiff")  # Pillow applies the orientation
    if tags.bits <= 8:
        return _decoded(path, image, "RGB")
    kind = np.float32 if tags.is_float else np.uint16 if tags.bits == 16 else np.uint32
    return _decoded(path, image).astype(kind, copy=False)


def read_depth(path: Path, layer: str | None = None) -> tuple[Image2D, int]:
    """Read depth in stored units as (H, W) float32, and the bits of its integers; 0 for floats.

    It reads EXR, PFM, NumPy's files, 32-bit float TIFF, and grey PNG, TIFF, JPEG, WebP or AVIF: one
    channel, or three equal ones.

    Parameters
    ----------
    layer : str or None
        Layer of an EXR file. Default: the layer named as depth, or the only one.

    Raises
    ------
    FormatError
        As `read_color`, or the picture is in colors.
    """
    kind = _kind_with(path, "depth", layer)
    if kind == "exr":
        return _with_bits(exr.read_exr_depth(path, layer))
    if kind in ("npy", "npz"):
        return _with_bits(read_numpy(path))
    if kind == "pfm":
        return read_pfm(path), 0
    if kind == "hdr":
        raise FormatError(f"{path}: a picture in colors; {exr.NO_DEPTH}")
    stored = _pixels(path, kind)
    if stored.ndim == 3 and not all(
        np.array_equal(stored[..., 0], stored[..., k], equal_nan=True) for k in (1, 2)
    ):
        raise FormatError(f"{path}: a picture in colors; {exr.NO_DEPTH}")
    return _with_bits(stored[..., 0] if stored.ndim == 3 else stored)


def _with_bits(stored: NDArray[Any]) -> tuple[Image2D, int]:
    with np.errstate(over="ignore"):
        values = np.ascontiguousarray(stored, np.float32)
    return values, 0 if stored.dtype.kind == "f" else 8 * stored.dtype.itemsize


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


def read_header(path: Path, layer: str | None = None) -> Header:
    """Read the header of a color picture.

    Parameters
    ----------
    layer : str or None
        As in `read_color`.

    Raises
    ------
    FormatError
        As `read_color`.
    """
    kind = file_kind(path)
    if kind == "exr":
        return Header(*exr.exr_size(path, layer), has_end=False)
    if kind == "hdr":
        return Header(*hdr_size(path), has_end=False)
    if kind == "tiff":
        tags = read_tags(path)
        is_turned = tags.orientation in TURNED
        size = (tags.height, tags.width) if is_turned else (tags.width, tags.height)
        return Header(*size, not tags.is_float, tags.xmp, orientation=tags.orientation)
    image = _open_pillow(path, kind)
    size, orientation = (image.width, image.height), orientation_of(image)
    size = size[::-1] if orientation in TURNED else size
    has_end, unread = True, ""
    if names_gain_map(image):
        has_end = kind != "jpeg" or read_gain_map(path) is None
        unread = NO_GAIN_MAP if has_end else ""
    return Header(*size, has_end, xmp_of(image), unread, orientation)


def picture_size(path: Path) -> tuple[int, int]:
    """Return width and height of a picture, from its header; raises as `read_header`."""
    header = read_header(path)
    return header.width, header.height


def _kind_with(path: Path, key: str, layer: str | None) -> str:
    """Return the kind of a file; raise FormatError for a layer of anything but EXR."""
    kind = file_kind(path)
    if layer is not None and kind != "exr":
        raise FormatError(
            f"{path}: --{key}-layer ({key}_layer in scene.toml) is for EXR files; this one has no "
            "layers"
        )
    return kind


def decode_srgb(coded: NDArray[Any]) -> Image2D:
    """Decode uint8 or uint16 sRGB values to linear float32 in [0, 1] (IEC 61966-2-1)."""
    steps = np.iinfo(coded.dtype).max
    value = np.arange(steps + 1, dtype=np.float64) / steps
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    table, decoded = linear.astype(np.float32), np.empty(coded.shape, np.float32)
    for row in range(0, len(coded), LOOKUP_ROWS):
        rows = slice(row, row + LOOKUP_ROWS)
        # All values are in the table. In the default mode, NumPy would first copy the output.
        np.take(table, coded[rows], out=decoded[rows], mode="clip")
    return decoded


def srgb_encode(linear: NDArray[Any]) -> NDArray[np.float64]:
    """Return the sRGB transfer curve (IEC 61966-2-1) of linear values in [0, 1]."""
    values = np.asarray(linear, np.float64)
    curved = 1.055 * np.power(np.maximum(values, 0.0031308), 1.0 / 2.4) - 0.055
    return np.where(values <= 0.0031308, 12.92 * values, curved)


def _is_16_bit(image: Image.Image) -> bool:
    # Pillow reports mode RGB for 16-bit color; the decoder's raw mode is reliable.
    tiles = getattr(image, "tile", [])
    return image.mode.startswith("I") or (bool(tiles) and "16" in str(tiles[0][3]))


def _open_pillow(path: Path, kind: str) -> Image.Image:
    if (kind == "heic" and not _reads_heic()) or (kind == "avif" and not features.check("avif")):
        install = "install the extra `heic` (pip install 'iprt[heic]'), or " * (kind == "heic")
        raise FormatError(
            f"{path}: {kind.upper()} is not read; {install}convert it, for example by "
            f"heif-convert {quote(path.name)} {quote(path.stem + '.png')}"
        )
    if kind not in _PILLOW_FORMATS:
        raise FormatError(f"{path}: {_DEPTH_ONLY.get(kind, kind.upper())} is no picture in colors")
    if kind in ("avif", "heic"):
        require_sdr(path, kind)
    # Given a file name, Pillow maps raw TIFF and swaps rows and columns of rotated pictures.
    source = BytesIO(read_bytes(path)) if kind == "tiff" else path
    return open_picture(source, path, (_PILLOW_FORMATS[kind],))


def _reads_heic() -> bool:
    """Return True if Pillow reads HEIC, with the extra `heic`."""
    try:
        from pillow_heif import register_heif_opener
    except ImportError:
        return False
    register_heif_opener()
    return True


def open_picture(
    source: Path | BytesIO, path: Path, formats: Sequence[str] = TEXTURE_FORMATS
) -> Image.Image:
    """Open a picture lazily: read its header and check its size; `path` names it in errors.

    Raises
    ------
    FormatError
        The picture is damaged, too large, or of none of Pillow's `formats`.
    """
    # Without a list of formats, Pillow runs Ghostscript on files that look like PostScript.
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
    """Return (H, W, 3) sRGB of a mesh loader's picture; `path` names it in errors.

    Raises
    ------
    FormatError
        The picture is damaged, too large, or of an unread format.
    """
    # MPO is JPEG with further pictures appended; without a format, the loader made it in memory.
    if image.format not in (*TEXTURE_FORMATS, "MPO", None):
        raise FormatError(f"{path}: a texture is no {', '.join(TEXTURE_FORMATS)} picture")
    require_picture_size(path, image.width, image.height)
    return _decoded(path, image, "RGB").astype(np.uint8, copy=False)


def has_alpha(image: Image.Image) -> bool:
    """Return True if a picture has an alpha channel or a transparent color."""
    return "A" in image.getbands() or "transparency" in image.info


def texture_alpha(image: Image.Image, path: Path) -> NDArray[np.uint8]:
    """Return the alpha channel (H, W) of a mesh loader's picture; errors as `texture_pixels`."""
    return _decoded(path, image, "RGBA")[..., 3].astype(np.uint8, copy=False)


def _decoded(path: Path, image: Image.Image, mode: str | None = None) -> NDArray[Any]:
    """Decode a picture, converted to one of Pillow's modes."""
    with _quiet(), decoding(path, DAMAGED):
        return np.asarray(image if mode in (None, image.mode) else image.convert(mode))


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence Pillow's warnings about sizes, which are checked here, and odd palettes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
