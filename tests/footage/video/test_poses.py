"""Poses of frames: read as written, or one line for each that is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.errors import SceneError
from iprt.scene.scene import Scene
from tests.footage.video.test_stream import write_video


def pose(angle: float, *at: float) -> NDArray[np.float64]:
    cos, sin = np.cos(angle), np.sin(angle)
    matrix = np.eye(4)
    matrix[:3, :3] = [[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]
    matrix[:3, 3] = at
    return matrix


POSES = [pose(0.1 * i, 0.2 * i, 1.0, -i) for i in range(3)]


def write(folder: Path, lines: list[str]) -> Path:
    if not (folder / "scene.toml").exists():
        write_video(folder, 3)
        manifest = (folder / "scene.toml").read_text()
        (folder / "scene.toml").write_text(manifest + 'poses = "poses.txt"\n')
    (folder / "poses.txt").write_text("\n".join(lines) + "\n")
    return folder


def line(matrix: NDArray[np.float64], digits: int = 17) -> str:
    return " ".join(f"{value:.{digits}g}" for value in matrix.ravel())


def test_frames_have_the_poses_of_their_lines(tmp_path: Path) -> None:
    text = ["# world from capture", "", line(POSES[0]), line(POSES[1]) + "  # moved"]
    scene = Scene.open(write(tmp_path, [*text, "\t" + line(POSES[2]).replace(" ", "\t")]))
    with scene.stream([3, 1, 2]) as frames:
        found = {frame.index: frame.pose for frame in frames}
    for index, expected in enumerate(POSES, 1):
        pose = found[index]
        assert pose is not None
        assert np.allclose(pose, expected, rtol=0, atol=1e-14)
        alone = scene.frame(index).pose
        assert alone is not None
        assert np.array_equal(alone, pose)


def test_without_poses_there_are_none(tmp_path: Path) -> None:
    assert Scene.open(write_video(tmp_path, 1)).frame().pose is None


def test_rounded_rotations_become_rotations(tmp_path: Path) -> None:
    scene = Scene.open(write(tmp_path, [line(matrix, 4) for matrix in POSES]))
    for index in (1, 2, 3):
        found = scene.frame(index).pose
        assert found is not None
        turn = found[:3, :3]
        assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(turn) == pytest.approx(1.0)
        assert np.allclose(found, POSES[index - 1], atol=1e-3)


def test_a_held_depth_keeps_the_frames_pose_and_a_held_frame_its_own(tmp_path: Path) -> None:
    scene = Scene.open(write(tmp_path, [line(matrix) for matrix in POSES]))
    (tmp_path / "d.002.exr").unlink()
    (tmp_path / "c.003.exr").unlink()
    with scene.stream([1, 2, 3]) as frames:
        poses = [frame.pose for frame in frames]
    assert np.array_equal(poses[1], scene.source.pose(2))
    assert np.array_equal(poses[2], scene.source.pose(2)), "of the picture that is shown"


GOOD = line(POSES[0])
SCALED, MIRRORED = POSES[1].copy(), POSES[1].copy()
SCALED[:3, :3] *= 1.01
MIRRORED[:3, 0] *= -1.0


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ("1 2 3", "line 2: expected 16 numbers, found 3"),
        (GOOD + " 1", "line 2: expected 16 numbers, found 17"),
        (GOOD.replace("0 0 0 1", "0 0 1 1"), "line 2: the last four must be 0 0 0 1"),
        (GOOD.replace("1", "x", 1), "line 2: 'x' is not a number"),
        (GOOD.replace("1", "nan", 1), "line 2: nan: at most 1e+06"),
        (GOOD.replace("1", "1e999", 1), "line 2: inf: at most 1e+06"),
        (GOOD.replace("1", "\x1b[31m", 1), "line 2: '\\x1b[31m' is not a number"),
        (line(SCALED), "line 2: scales or shears: a pose is a rotation"),
        (line(MIRRORED), "line 2: mirrors: a pose is a rotation"),
        ("# nothing", "2 poses, but the video has 3 frames; each needs a line"),
        (GOOD + "\n" + GOOD, "4 poses, but the video has 3 frames; each needs a line"),
        (GOOD + "\n" * 200_000, "bytes; at most"),
    ],
)  # fmt: skip
def test_what_is_no_pose_is_one_line(bad: str, message: str, tmp_path: Path) -> None:
    write(tmp_path, [GOOD, bad, GOOD])
    with pytest.raises(SceneError) as error:
        Scene.open(tmp_path)
    assert f"video.poses: {tmp_path / 'poses.txt'}: {message}" in str(error.value) or (
        "at most" in message and message in str(error.value)
    )
    assert len(str(error.value).splitlines()) == 1


def test_all_bad_poses_are_told(tmp_path: Path) -> None:
    write(tmp_path, ["1", GOOD, "2"])
    with pytest.raises(SceneError) as error:
        Scene.open(tmp_path)
    assert "2 problems" in str(error.value)
    assert [part in str(error.value) for part in ("line 1: ", "line 3: ")] == [True, True]


def test_a_missing_file_of_poses(tmp_path: Path) -> None:
    write(tmp_path, [GOOD])
    (tmp_path / "poses.txt").unlink()
    with pytest.raises(SceneError, match=r"video\.poses: .*poses\.txt: no such file"):
        Scene.open(tmp_path)
