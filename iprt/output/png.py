"""PNG output: display-referred pictures of linear radiance."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.atomic import replacing
from iprt.output.display import require_radiance
from iprt.output.tone import Bytes, developed


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
