"""`iprt capture`: from files to a scene that renders; every mistake is a line."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.capture.sequence import RgbdSequence
from iprt.files.exr import read_exr
from iprt.files.images import read_color, read_depth
from iprt.geometry.camera import View
from iprt.measure.metrics import psnr
from iprt.output.display import srgb_encode
from tests.capture.sequences import (
    STEP_M,
    Array,
    Camera,
    looking_around,
    noisy,
    room,
    write_tum,
)
from tests.scene.files import CUBE, write_channels, write_png16_grey, write_rgb

CAMERA = Camera(80, 60, 55.0)
POSES = [*looking_around(10, (0.0, 45.0, -45.0)), *looking_around(3, (85.0, -85.0))]


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    random = np.random.default_rng(8)

    def shoot(number: int, origin: Array, rays: Array) -> tuple[Array, Array]:
        color, depth = room(origin, rays)
        return color, noisy(depth, random)

    return write_tum(tmp_path_factory.mktemp("tum") / "s", CAMERA, POSES, shoot)


@pytest.fixture
def own(sequence: Path, tmp_path: Path) -> Path:
    """A copy to spoil."""
    return shutil.copytree(sequence, tmp_path / "own")


def run(*words: object) -> int:
    return cli.main([str(word) for word in words])


SIZE = ("--size", 256, 128)


def test_a_captured_scene_renders_like_the_true_panorama(sequence: Path, tmp_path: Path) -> None:
    # The panorama's centre in the world of the poses, which has +Z up.
    center = ("--center", "0.1,-0.2,0.05")
    assert run("capture", sequence, "-o", tmp_path / "captured", *SIZE, *center) == 0
    color, t = room(np.array([0.1, 0.05, 0.2]), View(256, 128, projection="equirect").directions())
    write_rgb(tmp_path / "color.exr", color.astype(np.float32))
    write_channels(tmp_path / "depth.exr", Z=t.astype(np.float32))
    files = ("--color", tmp_path / "color.exr", "--depth", tmp_path / "depth.exr")
    assert run("scene", "new", tmp_path / "true", *files) == 0
    (tmp_path / "cube.obj").write_text(CUBE)
    pictures = {}
    for name in ("true", "captured"):
        scene = tmp_path / name
        words = ("--look", "10,-50", "--height", 0.4, "--material", "diffuse:0.6,0.5,0.4")
        assert run("scene", "add", scene, tmp_path / "cube.obj", *words) == 0
        for method in ("iprt", "ibl"):
            output = tmp_path / f"{name}-{method}.exr"
            flags = ("--view", "cube", "--size", 64, 48, "--accumulate", 4, "--method", method)
            assert run("render", scene, "-o", output, *flags) == 0
            pictures[name, method] = srgb_encode(np.clip(read_color(output), 0.0, 1.0))
    for method in ("iprt", "ibl"):
        true, captured = (pictures[name, method].astype(float) for name in ("true", "captured"))
        assert psnr(captured, true) > 30.0
    methods = (pictures["true", method].astype(float) for method in ("iprt", "ibl"))
    assert psnr(*methods) < 40.0  # there is a shadow to be right about


def test_what_was_seen_is_a_layer_of_the_color(sequence: Path, tmp_path: Path) -> None:
    assert run("capture", sequence, "-o", tmp_path / "s", *SIZE, "--every", 4) == 0
    (seen,) = read_exr(tmp_path / "s/color.exr", [("seen.Y",)])
    depth, _ = read_depth(tmp_path / "s/depth.exr")
    assert set(np.unique(seen)) == {0.0, 0.5, 1.0}
    np.testing.assert_array_equal(seen > 0.0, depth > 0.0)
    assert run("scene", "check", tmp_path / "s") == 0


def test_numbered_pictures_are_read_like_tum_ones(own: Path) -> None:
    tum = RgbdSequence.open(own)
    rows = [" ".join(f"{value:.8f}" for value in shot.pose.ravel()) for shot in tum.shots]
    (own / "poses.txt").write_text("# world from camera\n" + "\n".join(rows))
    with (own / "camera.toml").open("a") as file:
        file.write('color = "rgb/%04d.png"\ndepth = "depth/%04d.png"\nposes = "poses.txt"\n')
    numbered = RgbdSequence.open(own)
    assert len(numbered.shots) == len(tum.shots) == len(POSES)
    for a, b in zip(numbered.shots, tum.shots, strict=True):
        assert (a.color, a.depth) == (b.color, b.depth)
        np.testing.assert_allclose(a.pose, b.pose, atol=1e-6)


@pytest.mark.parametrize("up", ["x", "-x", "y", "-y", "z", "-z"])
def test_up_becomes_y(up: str, own: Path) -> None:
    with (own / "camera.toml").open("a") as file:
        file.write(f'up = "{up}"\n')
    turn = RgbdSequence.open(own).world_from_poses
    axis = np.zeros(3)
    axis["xyz".index(up[-1])] = -1.0 if up.startswith("-") else 1.0
    np.testing.assert_allclose(turn @ axis, [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_the_nearest_in_time_belong_together(own: Path) -> None:
    lines = (own / "depth.txt").read_text().splitlines()
    (own / "depth.txt").write_text("\n".join(line for line in lines if "0005" not in line))
    shots = RgbdSequence.open(own).shots
    # Depth 5 was 6 ms away, its neighbours are 27 and 39 ms.
    assert [shot.color.name for shot in shots] == [
        f"{number:04d}.png" for number in range(len(POSES)) if number != 5
    ]
    assert all(shot.color.name == shot.depth.name for shot in shots)


def test_depth_that_is_none_is_left_out(own: Path) -> None:
    depth = np.full((60, 80), 1.5, np.float32)
    depth[:10] = [np.nan, np.inf, -1.0, 0.0] * 20
    write_channels(own / "depth/0000.exr", Z=depth)
    text = (own / "depth.txt").read_text().replace("depth/0000.png", "depth/0000.exr")
    (own / "depth.txt").write_text(text)
    picture = RgbdSequence.open(own).read(0)
    assert not picture.depth[:10].any()
    assert (picture.depth[10:] == 1.5).all()  # floats are metres
    second = RgbdSequence.open(own).read(1).depth
    assert np.abs(second / STEP_M - np.rint(second / STEP_M)).max() < 1e-2


def spoil(name: str, old: str = "", new: str = "") -> Callable[[Path], None]:
    """Replace a text in a file of a sequence; without texts, take the file away."""

    def change(folder: Path) -> None:
        path = folder / name
        if not old:
            path.unlink()
        else:
            assert old in path.read_text()
            path.write_text(path.read_text().replace(old, new, 1))

    return change


def other_size(folder: Path) -> None:
    write_png16_grey(folder / "depth/0000.png", np.full((30, 40), 9000, np.uint16))


def no_depth(folder: Path) -> None:
    for path in (folder / "depth").iterdir():
        write_png16_grey(path, np.zeros((60, 80), np.uint16))


@pytest.mark.parametrize(
    ("change", "words", "message"),
    [
        (spoil("camera.toml"), (), "camera.toml: no such file; write one with fx, fy, cx, cy"),
        (spoil("camera.toml", "fx", "focus = 3\nfx"), (), "focus: unknown key"),
        (spoil("camera.toml", "fx = 55.0", "fx = -1"), (), "camera.toml: fx: "),
        (spoil("camera.toml", "fx", "fx ="), (), "camera.toml: not valid TOML"),
        (spoil("camera.toml", "fx", 'color = "a.png"\nfx'), (), "give color, depth and poses"),
        (spoil("rgb.txt"), (), "rgb.txt: no such file"),
        (
            spoil("rgb.txt", "rgb/0003.png", "rgb/0003.png x"),
            (),
            "rgb.txt: line 5: expected a time",
        ),
        (spoil("rgb.txt", "rgb/0003.png", "../0003.png"), (), "line 5: '../0003.png' leaves the"),
        (
            spoil("groundtruth.txt", "999.996", "nan"),
            (),
            "groundtruth.txt: line 1: expected a time",
        ),
        (spoil("depth/0002.png"), (), "0002.png: no such file"),
        (other_size, (), "40x30 pixels, but its colour has 80x60; register depth to colour"),
        (no_depth, (), "no surface, neither here nor in what follows"),
        (None, ("--size", 256, 256), "--size 256 256: expected twice as wide as high"),
        (None, ("--center", "1,2"), "--center 1,2: expected X,Y,Z in metres"),
        (None, ("--every", 0), "--every 0: expected 1 or more"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(
    change: Callable[[Path], None] | None,
    words: tuple[object, ...],
    message: str,
    own: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if change is not None:
        change(own)
    assert run("capture", own, "-o", tmp_path / "made", *SIZE, *words) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "made").exists()


def test_what_is_there_is_not_replaced(
    sequence: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "made").mkdir()
    (tmp_path / "made/mine.txt").write_text("mine")
    assert run("capture", sequence, "-o", tmp_path / "made", *SIZE) == 2
    assert "made: is there already; choose another folder" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "made").iterdir()] == ["mine.txt"]
    assert run("capture", tmp_path / "none", "-o", tmp_path / "other", *SIZE) == 2
    assert "none: no such folder" in capsys.readouterr().err
