"""Frames are prepared alike, whoever asks for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.footage.frame import Frame
from iprt.footage.prepare.reading import RawFrame
from iprt.footage.prepare.stages import Preparation
from iprt.footage.real_material import RealMaterial
from iprt.geometry.material import Material
from iprt.scene.scene import Scene

SCENES = Path(__file__).resolve().parents[3] / "scenes360"
H, W = 32, 64


def require_equal(frame: Frame, other: Frame) -> None:
    for name in ("color", "depth", "opening", "gloss", "color_map"):
        np.testing.assert_array_equal(getattr(frame, name), getattr(other, name))


@pytest.mark.parametrize("name", ["chart", "train"])
def test_a_frame_alone_is_the_first_of_a_stream(name: str) -> None:
    scene = Scene.open(SCENES / name)
    with scene.stream(scene.frame_indices[:1]) as frames:
        (first,) = frames
    require_equal(scene.frame(), first)
    require_equal(next(scene.preparation().frames([scene.raw_frame()])), first)


def test_stages_know_the_colors_of_the_frames_before() -> None:
    """Gloss is known by hue in the colors of the first frame; white balance may hide it."""
    rng = np.random.default_rng(3)
    color = rng.uniform(0.2, 1.0, (H, W, 1)).astype(np.float32) * np.ones(3, np.float32)
    brown = np.zeros((H, W), bool)
    brown[20:, :24] = True
    color[brown] *= np.float32((0.8, 0.4, 0.2))
    warm = np.float32((1.5, 1.0, 0.7))
    depth = np.full((H, W), 2.0, np.float32)
    floor = RealMaterial(
        "floor", Material("plastic", alpha=0.1), color=(0.8, 0.4, 0.2), color_tolerance=0.02
    )
    raws = [RawFrame(color, depth, None), RawFrame(color * warm, depth, None, index=1)]
    followed = list(Preparation(materials=(floor,)).frames(raws))
    for frame in followed:
        np.testing.assert_array_equal(frame.gloss, brown)
    np.testing.assert_allclose(followed[1].color_map, np.diag(1.0 / warm), atol=0.02)
    (alone,) = Preparation(materials=(floor,), drift=False).frames(raws[1:])
    assert alone.color_map is None
    assert not np.array_equal(alone.gloss, brown)
