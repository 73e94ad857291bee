"""Lights that were clipped, as a stage of a video: their gains hold, fade in, and end with cuts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from iprt import cli
from iprt.footage.frame import Frame
from iprt.footage.lights.summary import Recovered
from iprt.footage.prepare import clipped_lights as stage_module
from iprt.footage.prepare.clipped_lights import BLEND, ClippedLights
from iprt.scene.scene import Scene
from tests.footage.lamp_rooms import WARM, bright, clip, lamp, lamp_room, srgb
from tests.frame.radiosity import Lamp
from tests.scene.files import write_channels, write_rgb, write_scene


@pytest.fixture
def estimates(monkeypatch: pytest.MonkeyPatch) -> list[Frame]:
    """The frames from which gains are estimated."""
    seen: list[Frame] = []
    recover = stage_module.recover

    def record(frame: Frame, *rest: Any) -> Any:
        seen.append(frame)
        return recover(frame, *rest)

    monkeypatch.setattr(stage_module, "recover", record)
    return seen


def brightness(frame: Frame, where: NDArray[np.bool_]) -> float:
    return float(frame.color[where].mean())


def test_gains_stay_while_the_lights_do(estimates: list[Frame]) -> None:
    """Noise at the white level, and things that pass before the lamp, leave it as bright."""
    truth = lamp_room("gray", lamp(20.0))
    frame, lit = clip(truth), bright(truth)
    rng = np.random.default_rng(3)
    stage = ClippedLights(1.0)
    first = brightness(stage(frame), lit)
    column = int(np.median(np.nonzero(lit)[1]))
    for _ in range(8):
        noisy = frame.color - 0.02 * rng.random(frame.color.shape, np.float32)
        noisy[:, column] = 0.1
        found = stage(replace(frame, color=noisy))
        still = lit & (noisy.max(axis=-1) > 0.9)
        assert brightness(found, still) == pytest.approx(first, rel=0.15)
    assert len(estimates) == 1


def test_a_camera_that_stops_down_clips_less_of_a_lamp() -> None:
    """What rays find stays, in the colors of the reference frame."""
    truth = lamp_room("gray", lamp(20.0))
    lit = bright(truth)
    stage = ClippedLights(1.0)
    first = stage(clip(truth))
    dark = clip(replace(truth, color=truth.color * np.float32(0.5)))
    later = stage(replace(dark, color_map=2.0 * np.eye(3)))
    np.testing.assert_allclose(later.radiance[lit], first.radiance[lit], rtol=0.02)


@pytest.mark.thorough
def test_a_lamp_that_is_switched_on_fades_in(estimates: list[Frame]) -> None:
    one = Lamp(-1.2, -1.4, 0.4, (8.0,) * 3)
    other = Lamp(1.4, 1.5, 0.4, (24.0,) * 3)
    before, after = (lamp_room("gray", *lamps, rows=32) for lamps in ((one,), (one, other)))
    lit = np.abs(after.color - 24.0).max(axis=-1) < 1.0
    stage = ClippedLights(1.0)
    stage(clip(before))
    levels = [brightness(stage(clip(after)), lit) for _ in range(BLEND + 4)]
    assert len(estimates) == 2
    steps = np.diff(np.log([1.0, *levels]))
    assert (steps >= -1e-6).all()
    assert steps.max() < 1.2 * np.log(24.0) / BLEND
    assert levels[-1] == levels[-2] == pytest.approx(24.0, rel=0.3)
    assert len(estimates) == 2


@pytest.mark.thorough
def test_after_a_cut_other_lights_hold_at_once() -> None:
    one = Lamp(-1.2, -1.4, 0.4, (8.0,) * 3)
    other = Lamp(1.4, 1.5, 0.4, (24.0,) * 3)
    before, after = (lamp_room("gray", light, rows=32) for light in (one, other))
    stage = ClippedLights(1.0)
    stage(clip(before))
    alone = ClippedLights(1.0)(clip(after))
    assert alone.clipped is not None
    np.testing.assert_array_equal(stage(clip(after)).color, alone.color)


# In a scene -------------------------------------------------------------------------------------


def lamp_scene(folder: Path, name: str, extra: str = "") -> Scene:
    """The warm lamp in a room, clipped."""
    frame = clip(lamp_room("colored", WARM, rows=32))
    root = write_scene(folder)
    write_rgb(root / "color.exr", frame.color)
    write_channels(root / "depth.exr", Z=frame.depth)
    Image.fromarray(srgb(frame.color)).save(root / "color.png")
    manifest = (root / "scene.toml").read_text()
    manifest = manifest.replace('color = "color.exr"', f'color = "{name}"\n{extra}')
    (root / "scene.toml").write_text(manifest)
    return Scene.open(root)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "extra", "found"),
    [
        ("color.png", "", True),
        ("color.png", "white = inf", False),
        ("color.exr", "", False),
        ("color.exr", "white = 1.0", True),
    ],
)
def test_what_counts_as_clipped(tmp_path: Path, name: str, extra: str, found: bool) -> None:
    """Pictures of integers, and others where the manifest says so."""
    scene = lamp_scene(tmp_path / "lamp", name, extra)
    frame = scene.frame()
    assert (frame.clipped is not None) == found
    assert scene.clips == found
    with scene.stream([0]) as frames:
        (streamed,) = frames
    assert (streamed.clipped is not None) == found
    np.testing.assert_array_equal(streamed.color, frame.color)
    np.testing.assert_array_equal(streamed.picture, frame.picture)


@pytest.mark.thorough
def test_info_and_check_tell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = lamp_scene(tmp_path / "lamp", "color.png")
    told = Recovered.of(scene.frame(), 1.0)
    assert told is not None
    for verb in ("info", "check"):
        assert cli.main(["scene", verb, str(scene.root)]) == 0
        assert told.line() in capsys.readouterr().out
    assert told.line().startswith("1 clipped light in ")


@pytest.mark.parametrize("value", ["0", "-1.0", "nan", '"never"'])
def test_white_must_be_a_level(value: str, tmp_path: Path, fails: Callable[..., str]) -> None:
    root = write_scene(tmp_path / "room")
    text = (root / "scene.toml").read_text()
    (root / "scene.toml").write_text(text.replace("[video]", f"[video]\nwhite = {value}"))
    assert "video.white" in fails("scene", "info", root)
