"""Pictures as EXR and PNG files: checked before rendering, written atomically."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.atomic import replacing, require_writable
from iprt.output.display import Bytes, developed, require_radiance

SUFFIXES = (".exr", ".png")
_SCALAR_SUFFIX = {"depth": "Z", "coverage": "A"}
_GEOMETRIC = ("normal", "position", "motion")
HALF_MAX = float(np.finfo(np.float16).max)


def check_output(path: Path, *, aovs: Sequence[str] = ()) -> None:
    """Raise an error now if a picture with the layers `aovs` could not be written to `path` later.

    Raises
    ------
    FormatError
        Unknown suffix, layers in a format without them, or no permission to write.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise FormatError(
            f"{path}: unknown output format '{path.suffix}'; supported: {', '.join(SUFFIXES)}, and "
            "for video .mp4, .mov, .mkv"
        )
    if aovs and suffix != ".exr":
        raise FormatError(f"{path}: a {suffix} file holds no layers; write an .exr for --aov")
    require_writable(path)


def write_picture(
    path: Path,
    color: NDArray[np.float32],
    *,
    aovs: Mapping[str, NDArray[Any]] | None = None,
    exposure: float = 1.0,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write linear radiance (H, W, 3) in the format of the suffix of `path`, atomically.

    Parameters
    ----------
    aovs : mapping of name to array, optional
        Layers of an EXR file, see `write_exr`.
    exposure : float
        Used by display-referred formats only; EXR keeps scene-linear radiance.

    Raises
    ------
    FormatError
        As in `check_output` and the format's writer.
    """
    check_output(path, aovs=tuple(aovs or ()))
    if path.suffix.lower() == ".exr":
        write_exr(path, color, aovs=aovs, metadata=metadata)
    else:
        write_png(path, color, exposure=exposure, metadata=metadata)


def write_exr(
    path: Path,
    color: NDArray[np.float32],
    *,
    aovs: Mapping[str, NDArray[Any]] | None = None,
    metadata: Mapping[str, str] | None = None,
    half: bool = False,
) -> None:
    """Write an OpenEXR file, atomically.

    Parameters
    ----------
    color : (H, W, 3) float32
        Linear Rec.709 radiance: the channels R, G, B.
    aovs : mapping of name to (H, W) or (H, W, 1..4) array, optional
        Layers, as float32. A scalar is `depth.Z`, `coverage.A` or `<name>.Y`; a geometric vector
        (normal, position, motion) has X, Y, Z; any other R, G, B, A.
    metadata : mapping of str to str, optional
        String attributes of the header.
    half : bool
        Store the radiance as 16-bit floats, limited to their largest finite value.

    Raises
    ------
    FormatError
        A shape does not fit, or the file cannot be written.
    """
    import OpenEXR

    if color.ndim != 3 or color.shape[2] != 3 or color.size == 0:
        raise FormatError(f"color: expected an image of shape (H, W, 3), got {color.shape}")
    if half:
        pixels: NDArray[Any] = np.clip(color, -HALF_MAX, HALF_MAX).astype(np.float16)
    else:
        pixels = color.astype(np.float32, copy=False)
    channels: dict[str, NDArray[Any]] = {"RGB": np.ascontiguousarray(pixels)}
    for name, layer in (aovs or {}).items():
        if layer.shape[:2] != color.shape[:2]:
            raise FormatError(
                f"the layer '{name}' has shape {layer.shape}, the picture {color.shape}"
            )
        channels.update(_layer_channels(name, layer))
    header = {
        **(metadata or {}),
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
    }
    with replacing(path) as temporary, OpenEXR.File(header, channels) as file:
        file.write(str(temporary))


def _layer_channels(name: str, layer: NDArray[Any]) -> dict[str, NDArray[np.float32]]:
    values = layer.astype(np.float32, copy=False)
    if values.ndim == 2:
        return {f"{name}.{_SCALAR_SUFFIX.get(name, 'Y')}": np.ascontiguousarray(values)}
    if values.ndim != 3 or not 1 <= values.shape[2] <= 4:
        raise FormatError(f"the layer '{name}' has shape {layer.shape}: expected up to 4 channels")
    suffixes = "XYZW" if name in _GEOMETRIC else "RGBA"
    return {
        f"{name}.{suffixes[i]}": np.ascontiguousarray(values[..., i])
        for i in range(values.shape[2])
    }


def write_png(
    path: Path,
    color: NDArray[np.float32],
    *,
    exposure: float = 1.0,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write linear radiance (H, W, 3) as 8-bit sRGB, exposed and clipped to [0, 1], atomically.

    `metadata` becomes text chunks.

    Raises
    ------
    FormatError
        The radiance is not an image or not finite, or the file cannot be written.
    """
    try:
        require_radiance(color)
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from error
    write_pixels(path, developed(color, exposure), metadata=metadata)


def write_display_png(
    path: Path, image: NDArray[Any], *, metadata: Mapping[str, str] | None = None
) -> None:
    """Write a display-referred image (H, W, 3) in [0, 1] as 8-bit PNG, atomically."""
    write_pixels(path, np.rint(image * 255.0).astype(np.uint8), metadata=metadata)


def write_pixels(path: Path, pixels: Bytes, *, metadata: Mapping[str, str] | None = None) -> None:
    """Write a display-referred image, (H, W, 3) uint8, as PNG, atomically."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    text = PngInfo()
    for key, value in (metadata or {}).items():
        text.add_text(key, value)
    with replacing(path) as temporary:
        Image.fromarray(pixels).save(temporary, format="PNG", pnginfo=text)
