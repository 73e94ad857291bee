"""Video files each of whose frames tells its number, by luma and by depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iprt.scene.scene import Scene
from tests.footage.video.encoding import Track, plain

FRAMES = 24
B_FRAMES = {"bf": "3", "g": "10", "b_strategy": "0", "qp": "4"}
ALONE = {"g": "1", "slicecrc": "1", "level": "3"}
"""For FFV1: every frame by itself, with checksums."""


def luma(index: int) -> int:
    """The luma of a frame; lumas lie so far apart that no codec mixes them up."""
    return 30 + 8 * index


def colors(pixels: str, frames: int = FRAMES) -> list[list[np.ndarray]]:
    """Planes of 4:2:0 or 4:2:2 in 8 or 10 bits, a luma for each frame."""
    made = []
    for index in range(frames):
        planes = plain(luma(index), 64, 32)
        if "422" in pixels:
            planes[1:] = [np.repeat(plane, 2, axis=0) for plane in planes[1:]]
        if "10" in pixels:
            planes = [plane.astype("<u2") << 2 for plane in planes]
        made.append(planes)
    return made


def scene(folder: Path, video: str) -> Scene:
    (folder / "scene.toml").write_text(f'format = 1\nname = "v"\n[video]\n{video}\n')
    return Scene.open(folder)


def depths(frames: int = FRAMES) -> list[np.ndarray]:
    return [np.full((32, 64), 1000 + 10 * index) for index in range(frames)]


def color_track(frames: int = FRAMES, **options: object) -> Track:
    return Track("libx264", "yuv420p", colors("", frames), options=B_FRAMES, **options)  # type: ignore[arg-type]


def told(found: Scene, indices: list[int] | None = None) -> list[tuple[int, int]]:
    """Numbers of the frames of color and of depth that each frame shows."""
    with found.stream(indices or found.frame_indices) as frames:
        return [
            (_index_of(frame.color[0, 0, 0]), round((float(frame.depth[0, 0]) * 1000 - 1000) / 10))
            for frame in frames
        ]


def _index_of(linear: float) -> int:
    coded = 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055
    return round((coded * 219 + 16 - 30) / 8)
