"""OpenEXR output: linear radiance, auxiliary layers and metadata in one file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.atomic import replacing

_SCALAR_SUFFIX = {"depth": "Z", "coverage": "A"}
_GEOMETRIC = ("normal", "position", "motion")
_HALF_MAX = float(np.finfo(np.float16).max)


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
        pixels: NDArray[Any] = np.clip(color, -_HALF_MAX, _HALF_MAX).astype(np.float16)
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
