"""Clips of our scenes as files: what is written is what is read, and lamps keep their light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.measure.metrics import psnr
from iprt.output.display import display
from iprt.scene.scene import Scene
from scenes360.video import pq_encode, write_color, write_depth, ycbcr_10_bit

MANIFEST = """format = 1
name = "clip"

[video]
color = "color.mkv"
depth = "depth.mkv"
depth_scale = 1e-4
"""


def test_pq_is_the_standard_s() -> None:
    """Codes of BT.2408-7, table 1: 203 cd/m² at 58%, and ends at 10,000 cd/m²."""
    nits = np.array([0.0, 203.0, 1000.0, 10_000.0, 20_000.0])
    found = pq_encode((nits / 203.0).astype(np.float32))
    np.testing.assert_allclose(found, [0.0, 0.581, 0.752, 1.0, 1.0], atol=1e-3)


def test_grey_has_no_chroma() -> None:
    planes = ycbcr_10_bit(np.full((2, 3, 3), 0.5))
    assert planes.shape == (3, 2, 3)
    assert (planes[0] == 502).all()
    assert (planes[1:] == 512).all()
    primaries = ycbcr_10_bit(np.eye(3)[None])
    assert primaries[2, 0, 0] == primaries[1, 0, 2] == 960


@pytest.mark.parametrize("frames", [1, 5])
def test_what_is_written_is_read(tmp_path: Path, frames: int) -> None:
    """Depth to half a unit; color to the codec's error, and a lamp of 40 to some percent."""
    y, x = np.mgrid[0:32, 0:64]
    colors, depths = [], []
    for index in range(frames):
        waves = [0.3 + 0.2 * np.sin(0.2 * x + 0.1 * y + phase + index) for phase in (0, 1, 2)]
        color = np.stack(waves, axis=-1).astype(np.float32)
        color[8:16, 8:24] = (40.0, 30.0, 20.0)
        colors.append(color)
        depth = (2.0 + np.sin(0.1 * x + index) + 0.05 * y).astype(np.float32)
        depth[:4, :4] = 0.0
        depths.append(depth)
    write_color(tmp_path / "color.mkv", colors, fps=10.0, crf=4)
    write_depth(tmp_path / "depth.mkv", depths, fps=10.0, scale=1e-4)
    (tmp_path / "scene.toml").write_text(MANIFEST)
    scene = Scene.open(tmp_path)
    assert len(scene.frame_indices) == frames
    for index in scene.frame_indices:
        raw = scene.raw_frame(index)
        np.testing.assert_allclose(raw.depth, depths[index], atol=0.51e-4)
        assert psnr(display(raw.color), display(colors[index])) > 40.0
        lamp = raw.color[10:14, 12:20].mean((0, 1))
        np.testing.assert_allclose(lamp, (40.0, 30.0, 20.0), rtol=0.05)
