"""Layouts of other programs: frames show the room, gaps are counted, faults are one line."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.capture.panorama import MEASURED, capture_panorama
from iprt.capture.rgbd_sequence import RgbdSequence
from iprt.errors import IprtError
from iprt.geometry.camera import View
from tests.capture.layouts import (
    CAMERA,
    POSES,
    WRITERS,
    Y_DOWN,
    in_world,
    matrix_text,
    write_7_scenes,
    write_color,
    write_depth,
    write_nerfstudio,
    write_open3d,
    write_scannet,
    written,
)
from tests.capture.sequences import Z_UP, Camera, room, write_tum
from tests.scene.files import write_png16_grey


@pytest.mark.parametrize("layout", WRITERS)
def test_every_layout_gives_the_room(layout: str, tmp_path: Path) -> None:
    (tmp_path / "s").mkdir()
    sequence = RgbdSequence.open(WRITERS[layout](tmp_path / "s"))
    assert layout in sequence.found.name
    assert str(sequence.found).endswith(", 12 frames")
    assert "100% of depths agree" in sequence.settled.words
    for index, pose in enumerate(POSES):
        np.testing.assert_allclose(sequence.pose(index, np.zeros(3)), pose, atol=1e-6)
    picture = sequence.read(5)
    color, depth = room(POSES[5][:3, 3], CAMERA.rays() @ POSES[5][:3, :3].T)
    np.testing.assert_allclose(picture.depth, depth, atol=6e-4)
    # Color pictures with a margin of their own have other sides than depth.
    assert np.quantile(np.abs(picture.color - color), 0.95) < 0.03
    result = capture_panorama(sequence, width=64, center=np.zeros(3))
    _, expected = room(np.zeros(3), View(64, 32, projection="equirect").directions())
    measured = result.seen == MEASURED
    assert measured.mean() > 0.3
    assert result.left_out == 0
    assert np.quantile(np.abs(result.depth - expected)[measured], 0.9) < 0.02


def test_tum_pictures_named_by_their_time_need_no_lists(tmp_path: Path) -> None:
    """The trajectory may have the name that SLAM systems give it."""
    folder = write_tum(tmp_path / "s", CAMERA, POSES, lambda _, origin, rays: room(origin, rays))
    for name in ("rgb", "depth"):
        for line in (folder / f"{name}.txt").read_text().splitlines()[1:]:
            time, path = line.split()
            (folder / path).rename(folder / name / f"{time}.png")
        (folder / f"{name}.txt").unlink()
    (folder / "groundtruth.txt").rename(folder / "CameraTrajectory.txt")
    sequence = RgbdSequence.open(folder)
    assert "CameraTrajectory.txt" in str(sequence.found)
    for index, pose in enumerate(POSES):
        np.testing.assert_allclose(sequence.pose(index, np.zeros(3)), pose, atol=1e-5)


def test_gaps_and_poses_that_are_not_finite_are_skipped_and_counted(tmp_path: Path) -> None:
    folder = write_scannet(tmp_path)
    (folder / "pose/2.txt").write_text(4 * "-inf -inf -inf -inf\n")
    (folder / "pose/3.txt").write_text(4 * "nan nan nan nan\n")
    (folder / "pose/5.txt").unlink()
    (folder / "depth/7.png").unlink()
    (folder / "color/8.jpg").unlink()
    for name in ("color/10.jpg", "depth/10.png", "pose/10.txt"):
        (folder / name).unlink()
    sequence = RgbdSequence.open(folder)
    assert [shot.color.stem for shot in sequence.shots] == ["0", "1", "4", "6", "9", "11"]
    assert str(sequence.found).endswith(
        "6 frames; skipped: 2 with an invalid pose, 1 without a pose, 1 without color, "
        "1 without depth"
    )
    for index, number in enumerate((0, 1, 4, 6, 9, 11)):
        pose = sequence.pose(index, np.zeros(3))
        np.testing.assert_allclose(pose, POSES[number], atol=1e-6)


def test_a_log_may_leave_out_frames(tmp_path: Path) -> None:
    folder = write_open3d(tmp_path)
    lines = (folder / "trajectory.log").read_text().splitlines()
    for path in (folder / "image").iterdir():
        path.rename(path.with_name(f"{int(path.name[:6]) - 1}.png"))
    for path in (folder / "depth").iterdir():
        path.rename(path.with_name(f"{int(path.name[:6]) - 1}.png"))
    (folder / "trajectory.log").write_text("\n".join(lines[:15] + lines[20:]))
    sequence = RgbdSequence.open(folder)
    assert str(sequence.found).endswith("11 frames; skipped: 1 without a pose")
    assert [int(shot.depth.stem) for shot in sequence.shots] == [0, 1, 2, *range(4, 12)]


def test_numbered_pictures_may_have_gaps(tmp_path: Path) -> None:
    folder = write_7_scenes(tmp_path)
    poses = [" ".join(matrix_text(in_world(Y_DOWN, pose)).split()) for pose in POSES]
    for path in folder.glob("*.pose.txt"):
        path.unlink()
    poses[4] = " ".join(["nan", *poses[4].split()[1:]])
    (folder / "poses.txt").write_text("\n".join(poses))
    (folder / "frame-000003.color.png").unlink()
    (folder / "camera.toml").write_text(
        CAMERA.toml() + 'depth_scale = 0.001\nup = "-y"\ncolor = "frame-%06d.color.png"\n'
        'depth = "frame-%06d.depth.png"\nposes = "poses.txt"\n'
    )
    sequence = RgbdSequence.open(folder)
    assert "10 frames; skipped: 1 with an invalid pose, 1 without color" in str(sequence.found)
    np.testing.assert_allclose(sequence.pose(3, np.zeros(3)), POSES[5], atol=1e-6)


@pytest.mark.parametrize("count", [12, 16])
def test_a_line_of_numbers_for_each_picture_is_enough(count: int, tmp_path: Path) -> None:
    folder = write_open3d(tmp_path)
    (folder / "trajectory.log").unlink()
    rows = [matrix_text(in_world(Y_DOWN, pose)).split()[:count] for pose in POSES]
    (folder / "poses.txt").write_text("\n".join(" ".join(row) for row in rows))
    sequence = RgbdSequence.open(folder)
    assert str(sequence.found) == "numbered pictures (poses.txt), 12 frames"
    for index, pose in enumerate(POSES):
        np.testing.assert_allclose(sequence.pose(index, np.zeros(3)), pose, atol=1e-6)


@pytest.mark.parametrize("key", ["w", "fl_x", "fl_y", "cx", "cy"])
def test_transforms_may_lack_what_the_picture_tells(key: str, tmp_path: Path) -> None:
    folder = write_nerfstudio(tmp_path)
    data = json.loads((folder / "transforms.json").read_text())
    expected = RgbdSequence.open(folder).shots[0].camera
    data["camera_angle_x"] = 2.0 * np.arctan(0.5 * CAMERA.width / CAMERA.focal)
    del data[key]
    (folder / "transforms.json").write_text(json.dumps(data))
    found = RgbdSequence.open(folder).shots[0].camera
    np.testing.assert_allclose(list(vars(found).values()), list(vars(expected).values()))


def test_distortion_that_is_not_undone_is_said(tmp_path: Path) -> None:
    folder = write_nerfstudio(tmp_path)
    assert "distortion" not in str(RgbdSequence.open(folder).found)
    edited(lambda data: data.update(k1=-0.08, k2=0.01))(folder)
    assert "lens distortion is not undone" in str(RgbdSequence.open(folder).found)


def edited(change: Callable[[dict[str, object]], object]) -> Callable[[Path], object]:
    def edit(folder: Path) -> None:
        data = json.loads((folder / "transforms.json").read_text())
        change(data)
        (folder / "transforms.json").write_text(json.dumps(data))

    return edit


POSE, LOG, JSON = "frame-000001.pose.txt", "trajectory.log", "transforms.json"
WORDS = "these are no poses\n" * 500
BINARY = bytes(range(256)) * 50
FAULTS: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "pose of words": ("7-Scenes", written(POSE, WORDS), "line 1: 'these' is not a number"),
    "pose of 3 numbers": ("7-Scenes", written(POSE, "1 2 3"), "4x4 or 3x4 numbers, found 3"),
    "binary pose": ("7-Scenes", written(POSE, BINARY), "a binary file; expected a text"),
    "scaled pose": (
        "7-Scenes",
        written(POSE, matrix_text(np.diag([2.0, 2.0, 2.0, 1.0]))),
        "scales or shears",
    ),
    "transposed pose": (
        "7-Scenes",
        written(POSE, "1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n"),
        "the last four must be 0 0 0 1",
    ),
    "no intrinsics": (
        "7-Scenes",
        lambda f: (f / "camera-intrinsics.txt").unlink(),
        "camera.toml: no such file; write one",
    ),
    "intrinsics of another size": (
        "7-Scenes",
        written("camera-intrinsics.txt", "500 0 320\n0 500 240\n0 0 1\n"),
        "the principal point (320, 240) lies outside of pictures of 64x48",
    ),
    "log of words": ("Open3D", written(LOG, WORDS), "line 1: expected three whole numbers"),
    "log cut off": ("Open3D", written(LOG, "0 0 1\n1 0 0 0\n"), "expected 16 numbers, found 4"),
    "empty log": ("Open3D", written(LOG, ""), "12 without a pose"),
    "intrinsics of Open3D": ("Open3D", written("intrinsic.json", "{}"), "expected width, height"),
    "JSON of words": ("nerfstudio", written(JSON, WORDS), "not valid JSON"),
    "nested JSON": ("nerfstudio", written(JSON, "[" * 200_000), "not valid JSON"),
    "JSON list": ("nerfstudio", written(JSON, "[1, 2]"), "expected a JSON object"),
    "no frames": ("nerfstudio", written(JSON, "{}"), "has no list `frames`"),
    "frames of numbers": ("nerfstudio", written(JSON, '{"frames": [1]}'), "frames[0]: expected an"),
    "empty frames": ("nerfstudio", written(JSON, '{"frames": []}'), "no frame with color"),
    "no focal length": ("nerfstudio", edited(lambda d: d.pop("fl_x")), "neither fl_x nor"),
    "fisheye": (
        "nerfstudio",
        edited(lambda d: d.update(camera_model="OPENCV_FISHEYE")),
        "camera_model 'OPENCV_FISHEYE' is no pinhole",
    ),
    "outside": (
        "nerfstudio",
        edited(lambda d: d["frames"][1].update(file_path="../a.png")),  # type: ignore[index]
        "frames[1].file_path: '../a.png' leaves the folder",
    ),
    "short matrix": (
        "nerfstudio",
        edited(lambda d: d["frames"][1].update(transform_matrix=[[1, 2]])),  # type: ignore[index]
        "frames[1].transform_matrix: expected",
    ),
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return {name: write(tmp_path_factory.mktemp("s")) for name, write in WRITERS.items()}


@pytest.mark.parametrize(("layout", "fault", "message"), FAULTS.values(), ids=FAULTS)
def test_faults_are_one_line(
    layout: str,
    fault: Callable[[Path], object],
    message: str,
    folders: dict[str, Path],
    tmp_path: Path,
) -> None:
    folder = shutil.copytree(folders[layout], tmp_path / "s")
    fault(folder)
    with pytest.raises(IprtError) as raised:
        RgbdSequence.open(folder)
    assert message in str(raised.value)
    assert raised.value.lines == [str(raised.value)]
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 600


def test_what_is_no_sequence_is_told_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(IprtError, match=r"no sequence: neither transforms\.json") as raised:
        RgbdSequence.open(tmp_path)
    assert "\n" not in str(raised.value)
    with pytest.raises(IprtError, match=r"notes\.txt: is a file; give its folder"):
        RgbdSequence.open(tmp_path / "notes.txt")


def write_phone(folder: Path, color: Camera, depth: Camera) -> Path:
    """Write a sequence whose depth is smaller than color, with color's intrinsics alone."""
    for number, pose in enumerate(POSES):
        write_color(folder / f"color/{number}.jpg", color, pose)
        write_depth(folder / f"depth/{number}.png", depth, pose)
        (folder / "pose").mkdir(exist_ok=True)
        (folder / f"pose/{number}.txt").write_text(matrix_text(in_world(Z_UP, pose)))
    (folder / "camera.toml").write_text(color.toml())
    return folder


@pytest.mark.parametrize("width", [256, 260, 254])
def test_depth_may_be_smaller_than_color(width: int, tmp_path: Path) -> None:
    """Depth may be smaller by a fractional factor, and by a few pixels in aspect."""
    depth = Camera(64, 48, 44.0)
    sequence = RgbdSequence.open(write_phone(tmp_path, Camera(width, 192, 176.0), depth))
    picture = sequence.read(3)
    camera = picture.camera
    assert (camera.width, camera.height) == (64, 48)
    np.testing.assert_allclose([camera.fx, camera.fy], [176.0 * 64 / width, 44.0])
    np.testing.assert_allclose([camera.cx, camera.cy], [31.5, 23.5])
    assert "100% of depths agree" in sequence.settled.words
    color, _ = room(POSES[3][:3, 3], camera.rays() @ POSES[3][:3, :3].T)
    assert np.abs(picture.color - color).max() < 0.03


def test_clipped_pixels_make_the_pixel_of_depth_clipped(tmp_path: Path) -> None:
    folder = write_phone(tmp_path, Camera(256, 192, 176.0), CAMERA)
    image = np.asarray(Image.open(folder / "color/0.jpg")).copy()
    image[100:104, 40:44] = 255
    Image.fromarray(image).save(folder / "color/0.jpg", quality=98)
    picture = RgbdSequence.open(folder).read(0)
    assert picture.clipped[25, 10]
    assert picture.clipped.sum() < 10


def test_integer_depth_at_its_end_is_none(tmp_path: Path) -> None:
    folder = write_scannet(tmp_path)
    steps = np.full((CAMERA.height, CAMERA.width), 1500, np.uint16)
    steps[:, :10] = 65535
    write_png16_grey(folder / "depth/0.png", steps)
    picture = RgbdSequence.open(folder, "opencv").read(0)
    assert not picture.depth[:, :10].any()
    np.testing.assert_allclose(picture.depth[:, 10:], 1.5)
