"""`iprt bench-video`: which frames come in, and what is timed."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from iprt.commands.bench_video import bench_video
from iprt.device.compute import ComputeDevice
from iprt.errors import IprtError
from iprt.footage.frame import Frame
from iprt.measure.frame_preparation import HELD, WARM_UP, time_preparation
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.world.real.real_world import RealWorld

SCENES = Path(__file__).parents[2] / "scenes360"


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch) -> list[Frame]:
    """The frames that worlds go on to."""
    frames: list[Frame] = []
    load = RealWorld.load

    def noted(world: RealWorld, frame: Frame) -> None:
        frames.append(frame)
        load(world, frame)

    monkeypatch.setattr(RealWorld, "load", noted)
    return frames


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "size"), [("train", (64, 32)), ("chart", (96, 48))])
def test_frames_that_differ_come_in(
    device: ComputeDevice, loaded: list[Frame], name: str, size: tuple[int, int]
) -> None:
    """Of a video and of a still picture."""
    done: list[int] = []
    scene = Scene.open(SCENES / name)
    found = time_preparation(device, scene, Settings(), frames=5, size=size, progress=done.append)
    assert done == list(range(1, WARM_UP + 6))
    assert len(loaded) == WARM_UP + 5
    assert found.size == size == (loaded[0].width, loaded[0].height)
    for frame, following in pairwise(loaded):
        assert not np.array_equal(frame.color, following.color)
        assert not np.array_equal(frame.depth, following.depth)
    assert np.array_equal(loaded[0].color, loaded[HELD].color)
    assert min(found.first_ms, found.ms, found.preparing_ms, found.loading_ms) > 0.0
    assert {"picture", "surfaces", "pyramid"} <= {one.name for one in found.passes}
    assert all(one.device_ms < found.ms * 5 for one in found.passes)


@pytest.mark.thorough
def test_the_command_prints_both_ways(capsys: pytest.CaptureFixture[str]) -> None:
    given = {"repeat": 2, "size": (64, 32), "device": "cpu"}
    assert bench_video(SCENES / "train", **given) == 0
    assert "frames a second without decoding, over 2 frames" in " ".join(
        capsys.readouterr().out.split()
    )
    assert bench_video(SCENES / "train", json=True, **given) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["size"] == [64, 32]
    assert record["ms"] > 0.0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"size": (64, 64)}, "--size 64 64: a panorama is twice as wide as high"),
        ({"repeat": 0}, "--repeat 0"),
    ],
)
def test_bad_flags_are_named(given: dict[str, object], told: str) -> None:
    with pytest.raises(IprtError, match=told):
        bench_video(SCENES / "train", **given)
