"""Maps of materials as files, named in `scene.toml`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

from iprt.errors import FormatError
from iprt.files.images import (
    decode_srgb,
    has_alpha,
    open_picture,
    read_color,
    srgb_encode,
    texture_alpha,
)
from iprt.geometry.material import Material
from iprt.geometry.textures import Textures

MapName = Literal[
    "texture",
    "surface_texture",
    "normal_texture",
    "opacity_texture",
    "emission_texture",
    "clearcoat_normal_texture",
]
MAPS: tuple[MapName, ...] = get_args(MapName)
"""Attributes of `Material`, and keys of its table."""
COLORS = "texture", "emission_texture"
NORMALS = "normal_texture", "clearcoat_normal_texture"
PNG_ERROR = 1e-4
"""Largest error of a color in a PNG file; otherwise it is written as EXR."""


def read_map(path: Path, name: MapName) -> NDArray[np.float32]:
    """Return a map as `Material` has it.

    Colors may be of any format of pictures, linear or sRGB as the format has it. The others are
    PNG, JPEG or WebP files of linear values, with the channels of glTF (section 3.9): roughness in
    green and metalness in blue, normals as (1 + v) / 2, opacity in alpha, or in grey without it.

    Raises
    ------
    FormatError
        The file is missing or damaged, of another format, or too large.
    """
    if name in COLORS:
        return read_color(path)
    image, textures = open_picture(path, path), Textures(path)
    found: NDArray[np.float32] | None
    if name == "surface_texture":
        found = textures.surface(image)
    elif name in NORMALS:
        found = textures.normals(image, 1.0)
    else:
        stored = texture_alpha(image, path) if has_alpha(image) else np.asarray(image.convert("L"))
        found = np.divide(stored, 255.0, dtype=np.float32)
    assert found is not None
    return found


def with_maps(material: Material, maps: Mapping[MapName, NDArray[np.float32]]) -> Material:
    """Return a material with these maps; opacity without a texture gets a white one.

    Raises
    ------
    FormatError
        Opacity and texture differ in size.
    """
    given: dict[str, Any] = {str(key): image for key, image in maps.items()}
    opacity, texture = given.get("opacity_texture"), given.get("texture")
    if opacity is not None:
        if texture is None:
            given["texture"] = np.ones((*opacity.shape, 3), np.float32)
        elif texture.shape[:2] != opacity.shape:
            height, width = opacity.shape
            raise FormatError(
                f"opacity_texture has {width} x {height} pixels, texture "
                f"{texture.shape[1]} x {texture.shape[0]}; make them the same size"
            )
    return replace(material, **given)


def map_suffix(image: NDArray[np.float32], name: MapName) -> str:
    """Return the suffix of a file that holds a map: PNG, or EXR for colors that PNG cannot hold."""
    if name not in COLORS:
        return ".png"
    return ".png" if np.abs(decode_srgb(_bytes(image)) - image).max() <= PNG_ERROR else ".exr"


def write_map(path: Path, image: NDArray[np.float32], name: MapName) -> None:
    """Write a map to a file of the suffix that `map_suffix` returns."""
    if path.suffix == ".exr":
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, {"RGB": np.ascontiguousarray(image)}) as file:
            file.write(str(path))
        return
    if name in COLORS:
        pixels = _bytes(image)
    elif name == "surface_texture":
        stored = _rounded(image)
        pixels = np.stack([0 * stored[..., 0], stored[..., 1], stored[..., 0]], axis=-1)
    elif name in NORMALS:
        length = np.linalg.norm(image, axis=-1, keepdims=True)
        pixels = _rounded(0.5 + 0.5 * image / np.maximum(length, 1e-9))
    else:
        pixels = _rounded(image)
    Image.fromarray(pixels).save(path)


def _bytes(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    return _rounded(srgb_encode(np.clip(linear, 0.0, 1.0)))


def _rounded(values: NDArray[np.floating]) -> NDArray[np.uint8]:
    return np.asarray(np.rint(255.0 * np.clip(values, 0.0, 1.0)), np.uint8)
