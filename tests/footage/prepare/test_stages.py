"""Frames are prepared alike, whoever asks for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.footage.frame import OF_DEPTH, Frame
from iprt.footage.prepare import clipped_lights, gloss, stages
from iprt.footage.prepare.fill import CleanDepth, sanitize_depth
from iprt.footage.prepare.reading import Picture, RawFrame
from iprt.footage.prepare.stages import Preparation
from iprt.footage.real_material import Plane, RealMaterial
from iprt.geometry.material import Material
from iprt.scene.scene import Scene
from tests.footage.lamp_rooms import WARM, lamp_room

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


@pytest.fixture
def keeping(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own, which keeps results of panoramas of any size."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for stage in (stages, gloss, clipped_lights):
        monkeypatch.setattr(stage, "WORTH_KEEPING", 1)
    return tmp_path / "iprt" / "results"


def lit_rooms() -> list[RawFrame]:
    """Frames of a room whose lamp clips, with a glossy floor, noisy depth and a window."""
    frame = lamp_room("colored", WARM, rows=128)
    rng = np.random.default_rng(7)
    noise = rng.normal(1.0, 3e-3, frame.depth.shape).astype(np.float32)
    depth = frame.depth * noise
    depth[40:60, 20:50] = 0.0
    later = depth.copy()
    later[70:80, 100:120] = 0.0
    color = np.minimum(frame.color, np.float32(1.0))
    return [RawFrame(color, depth, None), RawFrame(color, later, None, index=1)]


def prepared(raws: list[RawFrame]) -> list[Frame]:
    floor = Plane((0.0, -1.5, 0.0), (0.0, 1.0, 0.0), 0.2)
    material = RealMaterial("floor", Material("plastic", alpha=0.1), plane=floor)
    return list(Preparation(1.0, (material,)).frames(raws))


def test_kept_results_are_the_ones_that_are_made(
    keeping: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The frames after the first follow from the same state, too."""
    raws = lit_rooms()
    made = prepared(raws)
    assert made[0].clipped is not None
    assert made[0].opening.any()
    assert made[0].gloss is not None
    assert made[0].gloss.any()
    assert not np.array_equal(made[0].depth, raws[0].depth)
    names = sorted(file.name.partition("-")[0] for file in keeping.iterdir())
    assert names == ["depth", "gains", "places"]

    calls: list[object] = []

    def counted(*given: Picture) -> CleanDepth:
        calls.append(given)
        return sanitize_depth(*given)

    monkeypatch.setattr(clipped_lights, "recover", None)  # not called
    monkeypatch.setattr(stages, "sanitize_depth", counted)
    read = prepared(raws)
    assert len(calls) == len(raws) - 1
    monkeypatch.undo()
    for frames in (read, prepared(raws)):
        for frame, other in zip(frames, made, strict=True):
            require_equal(frame, other)
            for name in OF_DEPTH:
                assert vars(frame)[name] == vars(other)[name]
            assert frame.clipped is not None
            assert other.clipped is not None
            np.testing.assert_array_equal(frame.clipped.texel, other.clipped.texel)
            np.testing.assert_array_equal(frame.clipped.color, other.clipped.color)


@pytest.mark.usefixtures("keeping")
def test_kept_holes_are_those_of_their_colors() -> None:
    """A small hole is a window if it is brighter than its rim, of which one row is enough."""
    color = np.ones((128, 256, 3), np.float32)
    depth = np.full((128, 256), 2.0, np.float32)
    depth[5, 40] = 0.0
    bright_rim = color.copy()
    bright_rim[4] = 9.0
    color[5, 40] = 4.0
    bright_rim[5, 40] = 4.0
    for _ in range(2):
        for picture, is_window in ((color, True), (bright_rim, False)):
            (frame,) = Preparation().frames([RawFrame(picture, depth, None)])
            assert frame.opening[5, 40] == is_window


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
