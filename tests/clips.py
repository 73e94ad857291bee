"""Tiny videos with an object, written to a folder: a room whose light goes around."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.scene.files import CUBE, box_room, directions, write_channels, write_rgb

SIZE = (32, 16)
"""The view's size in pixels."""

MANIFEST = """format = 1
name = "clip"

[video]
color = "color.%04d.exr"
depth = "depth.exr"
frames = [{first}, {last}]
fps = {fps}

[[objects]]
name = "cube"
mesh = "cube.obj"
to_world = [0.3, 0, 0, 0.1, 0, 0.3, 0, -1.0, 0, 0, 0.3, -1.6, 0, 0, 0, 1]
material = {{ kind = "plastic", albedo = [0.5, 0.3, 0.2], alpha = 0.2 }}

[[views]]
name = "ahead"
pitch_deg = -30.0
size = [{width}, {height}]
"""


def clip_color(number: int, width: int = 64) -> NDArray[np.float32]:
    """(width / 2, width, 3) radiance of the clip's frame: smooth, between 0.2 and 0.8."""
    w = directions(width, width // 2)
    turn = 0.4 * number
    wave = w[..., 0] * np.cos(turn) + w[..., 2] * np.sin(turn)
    return np.stack([0.5 + 0.3 * wave, 0.5 + 0.2 * w[..., 1], 0.5 - 0.3 * wave], -1).astype("f4")


def write_clip(
    folder: Path,
    frames: int = 6,
    *,
    first: int = 0,
    fps: float = 24.0,
    size: tuple[int, int] = SIZE,
) -> Path:
    """A scene of so many frames; the folder."""
    folder.mkdir(exist_ok=True, parents=True)
    for number in range(first, first + frames):
        write_rgb(folder / f"color.{number:04d}.exr", clip_color(number))
    depth, _ = box_room(64, 32)
    write_channels(folder / "depth.exr", Z=depth.astype(np.float32))
    (folder / "cube.obj").write_text(CUBE)
    width, height = size
    text = MANIFEST.format(
        first=first, last=first + frames - 1, fps=fps, width=width, height=height
    )
    (folder / "scene.toml").write_text(text)
    return folder
