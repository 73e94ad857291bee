"""`iprt capture`: from a folder to a scene that renders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.capture.scene import MEASURED, UNSEEN
from iprt.device.compute import ComputeDevice
from iprt.files.images import read_depth
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from tests.capture.layouts import write_7_scenes
from tests.capture.sequences import Camera, looking_around, room, write_tum
from tests.capture.test_capture import AROUND
from tests.rendering import render
from tests.scene.files import snapshot
from tests.worlds import ball

CAMERA = Camera(80, 60, 55.0)
POSES = [*AROUND, *looking_around(10, (20.0, -20.0))]


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sequence") / "room"
    return write_tum(folder, CAMERA, POSES, lambda _, origin, rays: room(origin, rays))


@pytest.mark.thorough
def test_a_captured_room_lights_objects_as_the_room_does(
    sequence: Path, tmp_path: Path, device: ComputeDevice, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "scene"
    words = [
        "capture",
        str(sequence),
        "-o",
        str(output),
        "--center",
        "0",
        "0",
        "0",
        "--size",
        "256",
        "128",
    ]
    assert cli.main(words) == 0
    printed = capsys.readouterr().out
    assert "of the sphere seen by 56 frames" in printed
    frame = Scene.open(output).frame(0)
    color, depth = room(np.zeros(3), View(256, 128, projection="equirect").directions())
    true = replace(frame, color=color.astype(np.float32), depth=depth.astype(np.float32))
    objects = [
        ball((0.3, -0.6, -1.2), 0.3, Material(albedo=(0.7, 0.6, 0.5))),
        ball((-0.4, -0.6, -1.1), 0.25, Material("conductor", (0.9, 0.9, 0.9), alpha=0.1)),
    ]
    view = View(64, 48, pitch_deg=-20.0)
    ours, theirs = (
        render(device, given, objects, view, Settings(fading=0.0), 8).color
        for given in (frame, true)
    )
    assert np.abs(ours - theirs).mean() < 0.04 * theirs.mean()


def test_what_was_never_seen_is_told_in_a_layer(
    sequence: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A few frames of many leave much of the sphere unseen: without depth, and named so."""
    output = tmp_path / "scene"
    words = ["capture", str(sequence), "-o", str(output), "--every", "30", "--no-compensate"]
    assert cli.main([*words, "--size", "64", "32"]) == 0
    printed = capsys.readouterr().out
    assert "read as TUM RGB-D (groundtruth.txt), 56 frames\n" in printed
    assert "poses: camera to world, OpenCV's axes (100% of depths agree); up: z\n" in printed
    seen, _ = read_depth(output / "color.exr", "seen.Y")
    depth, _ = read_depth(output / "depth.exr")
    assert (depth[seen == UNSEEN] == 0.0).all()
    assert (depth[seen == MEASURED] > 0.0).all()
    assert 0.2 < (seen == UNSEEN).mean() < 0.9


def test_a_convention_can_be_forced_and_what_does_not_fit_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], fails: Callable[..., str]
) -> None:
    folder = write_7_scenes(tmp_path)
    order = iter(np.random.default_rng(1).permutation(12))
    poses = sorted(folder.glob("*.pose.txt"))
    texts = [path.read_text() for path in poses]
    for path in poses:
        path.write_text(texts[next(order)])
    error = fails("capture", folder, "-o", tmp_path / "scene")
    assert "poses and depth agree by no convention (opencv " in error
    assert not (tmp_path / "scene").exists()
    words = ["capture", str(folder), "-o", str(tmp_path / "scene"), "--poses", "opengl"]
    assert cli.main([*words, "--size", "32", "16"]) == 0
    printed = capsys.readouterr().out
    assert "read as 7-Scenes (a pose file per frame), 12 frames\n" in printed
    assert "poses: camera to world, OpenGL's axes (--poses); up: " in printed


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--size", "64", "64"], "--size 64 64: expected twice as wide as high"),
        (["--every", "0"], "--every 0: expected 1 or more"),
        (["--center", "nan", "0", "0"], "--center nan 0 0: expected at most 100000 m from 0"),
    ],
)
def test_bad_values_are_one_line_and_make_nothing(
    words: list[str], message: str, sequence: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    assert message in fails("capture", sequence, "-o", tmp_path / "scene", *words)
    assert not (tmp_path / "scene").exists()


def test_nothing_that_is_there_is_overwritten(
    sequence: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    before = snapshot(sequence)
    assert "is there already" in fails("capture", sequence, "-o", sequence)
    assert snapshot(sequence) == before
    assert "no such folder" in fails("capture", tmp_path / "none", "-o", tmp_path / "scene")
    assert not (tmp_path / "scene").exists()
