"""`iprt scene` with video files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.scene.scene import Scene
from tests.footage.video.encoding import Track, grey16, plain, write_video


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """Color, and depth for every other frame; and the same as color alone."""
    colors = Track("libx264", "yuv420p", [plain(60 + 9 * i, 64, 32) for i in range(6)], rate=24)
    codes = [np.full((32, 64), 1000 + 10 * i) for i in range(3)]
    write_video(tmp_path / "Clip.MKV", colors, grey16(codes, rate=12))
    write_video(tmp_path / "color.mp4", colors)
    write_video(tmp_path / "depth.mkv", grey16(codes, rate=12))
    return tmp_path


def run(*words: str) -> int:
    return cli.main(["scene", *words])


def test_a_scene_of_one_file(clip: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = clip / "own"
    assert run("new", str(own), "--color", str(clip / "Clip.MKV"), "--depth-scale", "0.001") == 0
    assert "a scene of 6 frames" in capsys.readouterr().out
    assert sorted(path.name for path in own.iterdir()) == ["color.mkv", "scene.toml"]
    scene = Scene.open(own)
    assert scene.manifest.video.depth is None
    assert scene.source.fps == 24.0
    assert scene.frame(5).depth[0, 0] == pytest.approx(1.02)
    assert run("info", str(own), "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert record["frames"] == [0, 5]
    assert record["fps"] == 24.0
    (notice,) = record["notices"]
    assert "color.mkv has 12 frames per second, the video 24" in notice
    assert run("check", str(own)) == 0
    assert f"warning: {notice}" in capsys.readouterr().out


def test_a_scene_of_two_files_with_a_range(clip: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = clip / "own"
    words = ["--color", str(clip / "color.mp4"), "--depth", str(clip / "depth.mkv")]
    assert run("new", str(own), *words) == 2
    assert "depth.mkv: stores integers; give --depth-scale" in capsys.readouterr().err
    assert not own.exists()
    coded = ["--depth-range", "8", "0.5", "--depth-encoding", "inverse"]
    assert run("new", str(own), *words, *coded) == 0
    part = 1010 / 65535
    expected = 1 / ((1 - part) / 8 + part / 0.5)
    assert Scene.open(own).frame(3).depth[0, 0] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("ends", [("0", "5"), ("2", "2"), ("-1", "2"), ("1", "inf")])
def test_ranges_that_make_no_sense(
    ends: tuple[str, str], clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--color", str(clip / "Clip.MKV"), f"--depth-range={ends[0]}", ends[1]]
    assert run("new", str(clip / "own"), *words) == 2
    assert "--depth-range" in capsys.readouterr().err


def test_a_file_without_depth(clip: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--color", str(clip / "color.mp4"), "--depth-scale", "1"]
    assert run("new", str(clip / "own"), *words) == 2
    assert "color.mp4 holds no depth" in capsys.readouterr().err
    assert not (clip / "own").exists()
