"""The glossy surfaces that a manifest declares, with their masks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError
from iprt.files.images import read_color
from iprt.files.untrusted import MAX_PIXELS
from iprt.footage.real_material import RealMaterial
from iprt.scene.manifest import Manifest

Mask = NDArray[np.bool_]


def declared_materials(root: Path, manifest: Manifest) -> tuple[RealMaterial, ...]:
    """Return the `[[real_materials]]` of a scene in the folder `root`, in the manifest's order.

    Raises
    ------
    FormatError
        A mask cannot be read or is not twice as wide as high, or the masks are too large in total.
    """
    masks: dict[str, Mask] = {}
    for table in manifest.real_materials:
        if table.mask is not None and table.mask not in masks:
            masks[table.mask] = _mask(root / table.mask, manifest.video.yaw_offset_deg)
        if sum(mask.size for mask in masks.values()) > MAX_PIXELS:
            raise FormatError(
                f"{manifest.name}: its masks have more than the {MAX_PIXELS} pixels that are read"
            )
    return tuple(
        table.real_material(None if table.mask is None else masks[table.mask])
        for table in manifest.real_materials
    )


def _mask(path: Path, yaw_offset_deg: float) -> Mask:
    """Read a mask (h, w), rotated like the pictures of `[video]`."""
    mask = (read_color(path) > 0.0).any(axis=-1)
    height, width = mask.shape
    if width != 2 * height:
        raise FormatError(
            f"{path}: {width} x {height} pixels; a mask covers the whole panorama and is twice "
            "as wide as high"
        )
    columns = yaw_offset_deg / 360.0 * width
    return np.roll(mask, int(np.floor(columns + 0.5)), axis=1)
