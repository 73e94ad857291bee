"""Folders of hand-held sequences: both layouts give the same frames, faults are one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.capture.rgbd_sequence import RgbdSequence
from iprt.errors import IprtError
from tests.capture.layouts import written
from tests.capture.sequences import Camera, looking_around, room, write_tum
from tests.files.writing import exif
from tests.scene.files import write_png16_grey

CAMERA = Camera(24, 18, 16.0)
POSES = looking_around(5, (20.0,))


@pytest.fixture
def tum(tmp_path: Path) -> Path:
    return write_tum(tmp_path / "tum", CAMERA, POSES, lambda _, origin, rays: room(origin, rays))


def test_tum_lists_are_joined_by_time(tum: Path) -> None:
    """Poses are those of the scene, turned up; a picture without depth or pose is left out."""
    sequence = RgbdSequence.open(tum)
    assert len(sequence.shots) == len(POSES)
    for index, pose in enumerate(POSES):
        np.testing.assert_allclose(sequence.pose(index, np.zeros(3)), pose, atol=1e-5)
    picture = sequence.read(2)
    color, depth = room(POSES[2][:3, 3], CAMERA.rays() @ POSES[2][:3, :3].T)
    np.testing.assert_allclose(picture.color, color, atol=6e-3)
    np.testing.assert_allclose(picture.depth, depth, atol=2e-4)
    for name, line in (("depth.txt", 1), ("groundtruth.txt", 3)):
        lines = (tum / name).read_text().splitlines()
        del lines[line]
        (tum / name).write_text("\n".join(lines))
    kept = [shot.color.name for shot in RgbdSequence.open(tum).shots]
    assert kept == ["0001.png", "0002.png", "0004.png"]


@pytest.mark.parametrize("orientation", range(2, 9))
def test_poses_are_of_stored_pixels(tum: Path, orientation: int) -> None:
    """EXIF says how a person would hold the picture; depth and poses are the sensor's."""
    expected = RgbdSequence.open(tum).read(2)
    for path in (tum / "rgb").iterdir():
        Image.open(path).save(path, exif=exif(orientation))
    picture = RgbdSequence.open(tum).read(2)
    np.testing.assert_array_equal(picture.color, expected.color)
    assert picture.camera == expected.camera


@pytest.mark.parametrize("up", ["x", "-x", "y", "-y", "z", "-z"])
def test_any_axis_may_point_up(tum: Path, up: str) -> None:
    """What pointed up does so in the scene, and the turn is one: no mirror image."""
    with (tum / "camera.toml").open("a") as file:
        file.write(f'up = "{up}"\n')
    turn = RgbdSequence.open(tum).world_from_poses
    axis = np.zeros(3)
    axis["xyz".index(up[-1])] = -1.0 if up.startswith("-") else 1.0
    np.testing.assert_array_equal(turn @ axis, [0.0, 1.0, 0.0])
    np.testing.assert_allclose(np.linalg.det(turn), 1.0)


FAULTS: dict[str, tuple[Callable[[Path], object], str]] = {
    "no camera": (lambda f: (f / "camera.toml").unlink(), "camera.toml: no such file; write one"),
    "no key": (written("camera.toml", "fx = 20.0\nfy = 20.0\ncx = 1.0\n"), "cy"),
    "unknown key": (written("camera.toml", "fx=9\nfy=9\ncx=1\ncy=1\nfz=9\n"), "fz"),
    "no number": (written("camera.toml", "fx=nan\nfy=9\ncx=1\ncy=1\n"), "fx"),
    "half numbered": (
        written("camera.toml", 'fx=9\nfy=9\ncx=1\ncy=1\ncolor="rgb/%04d.png"\n'),
        "give color, depth and poses, or none",
    ),
    "no list": (lambda f: (f / "depth.txt").unlink(), "depth.txt"),
    "no time": (written("rgb.txt", "now rgb/0000.png\n"), "rgb.txt: line 1: expected a time"),
    "nothing listed": (written("rgb.txt", "# none\n"), "rgb.txt: lists nothing"),
    "outside": (written("rgb.txt", "1000.0 ../x.png\n"), "line 1: '../x.png' leaves the folder"),
    "other times": (written("groundtruth.txt", "5 0 0 0 0 0 0 1\n"), "has a depth and a pose"),
    "no rotation": (written("groundtruth.txt", "1000 0 0 0 0 0 0 2\n"), "a unit quaternion"),
    "no picture": (lambda f: (f / "rgb/0001.png").unlink(), "0001.png"),
    "damaged": (lambda f: (f / "depth/0001.png").write_bytes(b"x"), "0001.png"),
    "other size": (
        lambda f: write_png16_grey(f / "depth/0001.png", np.ones((12, 12), np.uint16)),
        "12x12 pixels, but its color has 24x18: another view; register depth to color",
    ),
}


@pytest.mark.parametrize(("fault", "message"), FAULTS.values(), ids=FAULTS)
def test_faults_are_one_line(tum: Path, fault: Callable[[Path], object], message: str) -> None:
    fault(tum)
    with pytest.raises(IprtError) as raised:
        RgbdSequence.open(tum).read(1)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_depth_that_is_no_number_is_no_depth(tum: Path) -> None:
    """NaN, infinite and negative depth, and colors that are not finite."""
    from iprt.output.picture import write_exr
    from tests.scene.files import write_channels

    sequence = RgbdSequence.open(tum)
    depth = np.full((18, 24), 2.0, np.float32)
    depth[0, :3] = np.nan, np.inf, -1.0
    color = np.full((18, 24, 3), 0.5, np.float32)
    color[1, 0] = np.nan
    write_channels(tum / "depth/d.exr", Z=depth)
    write_exr(tum / "rgb/c.exr", color)
    for name, path in (("rgb.txt", "rgb/c.exr"), ("depth.txt", "depth/d.exr")):
        (tum / name).write_text(f"1000.0 {path}\n")
    sequence = RgbdSequence.open(tum)
    picture = sequence.read(0)
    assert np.isfinite(picture.color).all()
    missing = np.zeros((18, 24), bool)
    missing[0, :3] = missing[1, 0] = True
    np.testing.assert_array_equal(picture.depth == 0.0, missing)
    assert (picture.depth[~missing] == 2.0).all()
