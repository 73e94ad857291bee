"""Conventions of poses follow from the surfaces that frames saw, whatever the layout says."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from iprt.capture.conventions import CONVENTIONS, up_axis
from iprt.capture.found import Convention
from iprt.capture.rgbd_sequence import RgbdSequence
from tests.capture.layouts import (
    CAMERA,
    FLIP,
    POSES,
    Y_DOWN,
    in_world,
    matrix_text,
    write_7_scenes,
    write_nerfstudio,
)
from tests.capture.sequences import Z_UP, Array, looking_around, noisy, room, write_tum


def stored(pose: Array, convention: Convention) -> Array:
    """Return a pose in OpenCV's axes, world from camera, in another convention."""
    turned = pose @ FLIP if convention.startswith("opengl") else pose
    return np.linalg.inv(turned) if convention.endswith("from-world") else turned


def rewrite_7_scenes(folder: Path, change: Callable[[Array], Array]) -> None:
    for number, pose in enumerate(POSES):
        text = matrix_text(change(in_world(Y_DOWN, pose)))
        (folder / f"frame-{number:06d}.pose.txt").write_text(text)


def rewrite_nerfstudio(folder: Path, change: Callable[[Array], Array]) -> None:
    data = json.loads((folder / "transforms.json").read_text())
    for frame, pose in zip(data["frames"], POSES, strict=True):
        frame["transform_matrix"] = change(in_world(Z_UP, pose)).tolist()
    (folder / "transforms.json").write_text(json.dumps(data))


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize(
    ("write", "rewrite", "own"),
    [
        (write_7_scenes, rewrite_7_scenes, "opencv"),
        (write_nerfstudio, rewrite_nerfstudio, "opengl"),
    ],
)
def test_the_data_decide(
    write: Callable[[Path], Path],
    rewrite: Callable[[Path, Callable[[Array], Array]], None],
    own: Convention,
    convention: Convention,
    tmp_path: Path,
) -> None:
    folder = write(tmp_path)
    rewrite(folder, lambda pose: stored(pose, convention))
    sequence = RgbdSequence.open(folder)
    assert sequence.settled.convention == convention
    assert "100% of depths agree" in sequence.settled.words
    assert ("as the layout has it" in sequence.settled.words) == (convention != own)
    for index, pose in enumerate(POSES):
        np.testing.assert_allclose(sequence.pose(index, np.zeros(3)), pose, atol=1e-6)
    wrong: Convention = "opengl" if convention == "opencv" else "opencv"
    forced = RgbdSequence.open(folder, wrong)
    assert forced.settled.convention == wrong
    assert np.abs(forced.shots[2].pose - sequence.shots[2].pose).max() > 0.5


def test_noise_of_poses_and_depth_changes_nothing(tmp_path: Path) -> None:
    random = np.random.default_rng(4)

    def shoot(_: int, origin: Array, rays: Array) -> tuple[Array, Array]:
        color, depth = room(origin + random.normal(0.0, 0.02, 3), rays)
        return color, noisy(depth, random)

    folder = write_tum(tmp_path / "s", CAMERA, POSES, shoot)
    settled = RgbdSequence.open(folder).settled
    assert settled.convention == "opencv"
    assert "as the layout has it" not in settled.words


def test_frames_that_share_nothing_leave_the_layouts_convention(tmp_path: Path) -> None:
    poses = [looking_around(4, (0.0,))[number] for number in (0, 2)]
    folder = write_tum(tmp_path / "s", CAMERA, poses, lambda _, origin, rays: room(origin, rays))
    settled = RgbdSequence.open(folder).settled
    assert settled.convention == "opencv"
    assert "not checked" in settled.words


def test_what_points_up_is_told_by_the_cameras() -> None:
    level = np.stack([in_world(Y_DOWN, pose) for pose in POSES])
    assert up_axis(level, "opencv", None) == "-y"
    assert up_axis(level @ FLIP, "opengl", None) == "-y"
    assert up_axis(np.stack([in_world(Z_UP, pose) for pose in POSES]), "opencv", None) == "z"
    assert up_axis(level, "opencv", "z") == "z"
    # A world in the first camera's own axes has that camera's up, whatever the layout says.
    first = np.linalg.inv(level[0]) @ level
    assert up_axis(first, "opencv", "z") == "-y"
    assert up_axis(FLIP @ first @ FLIP, "opengl", "z") == "y"
