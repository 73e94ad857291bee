"""A flag that would have no effect is an error that names it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.clips import write_clip

STILL = [
    ("render SCENE -o a.png --codec hevc", "--codec hevc: has no effect on a.png"),
    ("render SCENE -o a%04d.exr --codec h264", "--codec h264: has no effect on a%04d.exr"),
    ("render SCENE -o a%04d.png --no-audio", "--no-audio: has no effect on a%04d.png"),
    (
        "render SCENE -o a.png --view equirect --size 200 128",
        "--size 200 128: the whole panorama is twice as wide as high; try --size 256 128",
    ),
    ("bench SCENE --view equirect --size 200 128", "try --size 256 128"),
    ("profile SCENE --view equirect --size 200 128", "try --size 256 128"),
    ("compare SCENE --one-at-a-time", "--one-at-a-time: is for --sweep"),
    ("compare SCENE --json --markdown", "--json and --markdown: give one of them"),
    ("view SCENE --web --size 100 100", "--size: is for a window"),
    (
        "scene new n --color c.exr --depth d.png --depth-scale 0.1 --depth-encoding inverse",
        "--depth-encoding inverse: needs --depth-range",
    ),
    (
        "scene new n --color c.exr --depth d.png --depth-encoding linear",
        "--depth-encoding linear: needs --depth-range",
    ),
    (
        "scene new n --color c.exr --depth d.png --depth-scale 1 --depth-range 1 2",
        "--depth-scale and --depth-range: give one of them",
    ),
]


@pytest.mark.parametrize(("line", "told"), STILL)
def test_flags_without_effect(
    line: str,
    told: str,
    scene: Path,
    fails: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert told in fails(*line.replace("SCENE", str(scene)).split())


def test_accumulated_frames_of_a_video_are_for_trails(
    tmp_path: Path, fails: Callable[..., str]
) -> None:
    folder = write_clip(tmp_path / "clip")
    line = fails("compare", folder, "--accumulate", 8)
    assert "--accumulate 8: has no effect on a video without --trails" in line
