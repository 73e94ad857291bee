"""A yard with an object below the open sky, in which a sun shines or not."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.clips import write_clip
from tests.scene.files import box_room, directions, write_channels, write_rgb

ROWS = 64
"""Least height of panoramas in which light is searched for."""


def write_yard(folder: Path, frames: int = 1, *, size: tuple[int, int] = (32, 16)) -> Path:
    """A scene with a cube, of so many equal frames; the folder."""
    write_clip(folder, frames, size=size)
    depth, _ = box_room(2 * ROWS, ROWS)
    up = directions(2 * ROWS, ROWS)[..., 1] > 0.1
    depth[up] = 0.0  # without a rim all around, this is open sky
    write_channels(folder / "depth.exr", Z=depth.astype(np.float32))
    color = np.where(up[..., None], (0.3, 0.5, 0.9), 0.4).astype(np.float32)
    for number in range(frames):
        write_rgb(folder / f"color.{number:04d}.exr", color)
    return folder
