"""`iprt capture`: from a folder to a scene that renders."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.capture.panorama import MEASURED, UNSEEN
from iprt.files.images import read_depth
from tests.capture.layouts import write_7_scenes
from tests.capture.sequences import Camera, looking_around, room, write_tum
from tests.capture.test_capture import AROUND
from tests.scene.files import snapshot

CAMERA = Camera(80, 60, 55.0)
POSES = [*AROUND, *looking_around(10, (20.0, -20.0))]


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sequence") / "room"
    return write_tum(folder, CAMERA, POSES, lambda _, origin, rays: room(origin, rays))


def test_what_was_never_seen_is_told_in_a_layer(
    sequence: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A few frames of many leave much of the sphere unseen: without depth, and named so."""
    output = tmp_path / "scene"
    words = ["capture", str(sequence), "-o", str(output), "--every", "30", "--no-compensate"]
    assert cli.main([*words, "--size", "64", "32"]) == 0
    printed = capsys.readouterr().out
    assert "read as TUM RGB-D (groundtruth.txt), 56 frames\n" in printed
    assert "of the sphere seen by " in printed
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
    assert "--poses" in error
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
