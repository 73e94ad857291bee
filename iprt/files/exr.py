"""OpenEXR pictures: header checks, the choice of a layer, and decoding by the OpenEXR library."""

from __future__ import annotations

import logging
import os
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.exr_header import Part, read_parts
from iprt.files.exr_layers import Layer, color_layer, depth_layer, layers_of, normal_layer
from iprt.files.message_text import printable
from iprt.files.primaries import Chromaticity, to_rec709
from iprt.files.safe_reading import decoding

LOG = logging.getLogger("iprt.files")
NO_DEPTH = (
    "false colors cannot be read as depth; export depth itself, in one channel, as EXR, PFM or "
    "16-bit grey PNG"
)
"""Message and remedy for depth in false colors."""
_warned: set[tuple[Path, bytes]] = set()
"""Folders and unusable chromaticities with a logged warning."""


def read_exr_color(path: Path, wanted: str | None = None) -> NDArray[np.float32]:
    """Read the picture as linear Rec.709 radiance (H, W, 3); values may be non-finite.

    The file's primaries and white point are converted. Unusable ones are ignored with a warning.

    Parameters
    ----------
    wanted : str or None
        Name of the layer. By default chosen by name; see `color_layer`.

    Raises
    ------
    FormatError
        The file is damaged, cut off, cropped or too large, or has no picture or several.
    """
    parts = read_parts(path)
    layer = color_layer(path, layers_of(parts), wanted)
    planes = _planes(path, parts, layer)
    color = np.empty((*planes[0].shape, 3), np.float32)
    for channel in range(3):
        color[..., channel] = planes[channel % len(planes)]
    stored = parts[layer.part].chromaticities
    matrix = None if stored is None or layer.is_single else _matrix(path, stored)
    if matrix is not None:
        with np.errstate(all="ignore"):
            for row in color:
                row[:] = row @ matrix.T
    return color


def read_exr_depth(path: Path, wanted: str | None = None) -> NDArray[np.generic]:
    """Read depth (H, W) in stored units: float16, float32 or uint32.

    Parameters
    ----------
    wanted : str or None
        Name of the layer. By default chosen by name; see `depth_layer`.

    Raises
    ------
    FormatError
        As `read_exr_color`, or the layer's channels differ: a picture in colors.
    """
    parts = read_parts(path)
    layer = depth_layer(path, layers_of(parts), wanted)
    plane, *others = _planes(path, parts, layer)
    if not all(np.array_equal(plane, other, equal_nan=True) for other in others):
        name = f"layer {printable(layer.name)}: " if layer.prefix else ""
        differ = f"{', '.join(layer.letters[:-1])} and {layer.letters[-1]} differ"
        raise FormatError(f"{path}: {name}a picture in colors, whose {differ}; {NO_DEPTH}")
    return plane


def read_exr_normal(path: Path) -> NDArray[np.float32]:
    """Read normals (H, W, 3), x, y, z, as stored.

    Raises
    ------
    FormatError
        As `read_exr_color`.
    """
    parts = read_parts(path)
    planes = _planes(path, parts, normal_layer(path, layers_of(parts)))
    return np.stack(planes, axis=-1).astype(np.float32)


def exr_size(path: Path, wanted: str | None = None) -> tuple[int, int]:
    """Read width and height from the header, and check that the file is complete.

    Parameters
    ----------
    wanted : str or None
        Name of the picture's layer, used if parts differ in size.

    Raises
    ------
    FormatError
        The file is damaged, or parts differ in size and several could be the picture.
    """
    parts = read_parts(path)
    if len({(part.width, part.height) for part in parts}) > 1:
        part = parts[color_layer(path, layers_of(parts), wanted).part]
    else:
        part = parts[0]
    return part.width, part.height


def exr_layers(path: Path) -> list[Layer]:
    """Return the layers of a file.

    Raises
    ------
    FormatError
        The file is damaged.
    """
    return layers_of(read_parts(path))


def layer_lines(path: Path) -> list[str]:
    """Describe the layers of a file, a line each below a line with its name.

    Raises
    ------
    FormatError
        The file is damaged.
    """
    parts = read_parts(path)
    rows = [
        (
            printable(layer.name),
            printable(layer.letters if layer.is_single else ", ".join(layer.letters)),
            f"{parts[layer.part].width} x {parts[layer.part].height}",
            layer.meaning,
        )
        for layer in layers_of(parts)
    ]
    widths = [max(len(row[column]) for row in rows) for column in range(4)] if rows else []
    lines = ("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)
    return [f"{path}:", *(f"  {line}" for line in lines)]


def _planes(path: Path, parts: list[Part], layer: Layer) -> list[NDArray[np.generic]]:
    """Decode the channels of a layer.

    Returns
    -------
    list of (H, W) array
        float16, float32 or uint32.
    """
    part = parts[layer.part]
    if not part.is_whole:
        raise FormatError(
            f"{path}: data window {part.window} differs from the display window; "
            "save the whole picture, not a crop"
        )
    for name in layer.channels:
        if part.channels[name] != (1, 1):
            raise FormatError(
                f"{path}: channel {printable(name)} is subsampled; save it at full resolution"
            )
    import OpenEXR

    OpenEXR.set_global_thread_count(os.cpu_count() or 1)
    known = {int(code) for code in OpenEXR.Compression.__members__.values()}
    for other in parts:
        if other.compression not in known:
            raise FormatError(
                f"{path}: its compression, {other.compression_name}, needs OpenEXR 3.4 or later; "
                "update the package OpenEXR, or save the file with ZIP"
            )
    with decoding(path, "damaged EXR file"):
        channels = OpenEXR.File(os.fspath(path), separate_channels=True).channels(layer.part)
        planes = [np.asarray(channels[name].pixels) for name in layer.channels]
    if any(plane.shape != (part.height, part.width) for plane in planes):
        raise FormatError(f"{path}: damaged EXR file (its pixels do not match its header)")
    return planes


def _matrix(path: Path, stored: bytes) -> NDArray[np.float32] | None:
    """Return the (3, 3) matrix to Rec.709 for the attribute `chromaticities`.

    It is None for Rec.709, and for unusable values, which are logged once per folder.
    """
    try:
        values = struct.unpack("<8f", stored)
        corners: list[Chromaticity] = list(zip(values[::2], values[1::2], strict=True))
        return to_rec709(corners)
    except (ValueError, struct.error) as error:
        if (path.parent, stored) not in _warned:
            _warned.add((path.parent, stored))
            LOG.warning(
                "%s: chromaticities cannot be used (%s); its colors are taken for Rec.709",
                path,
                error,
            )
        return None
