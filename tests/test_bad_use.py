"""Bad use and bad surroundings: flags, devices, full disks, interrupts; one line, nothing lost."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.scene.files import CUBE, box_room, snapshot, write_channels, write_rgb
from tests.waiting import DEADLINE_S, ROOT, run_python, until

BAD_RENDERS: dict[str, tuple[list[str], str]] = {
    "view": (["--view", "a"], "--view a: box has no such view; the views are: ahead, equirect"),
    "size 0": (["--size", "0", "0"], "--size 0 0: expected 1 to"),
    "size huge": (["--size", "100000", "100000"], "--size 100000 100000: expected 1 to"),
    "frames": (["--accumulate", "0"], "--accumulate 0: expected 1 to"),
    "layer": (["-o", "OUT/a.exr", "--aov", "wrm"], "--aov wrm: no such layer; the layers are: "),
    "kind": (["-o", "OUT/a.jpg"], "a.jpg: unknown output format '.jpg'"),
    "no kind": (["-o", "OUT/a"], "unknown output format ''"),
    "folder": (["-o", "OUT"], "unknown output format"),
    "below a file": (["-o", "OUT/room/cube.obj/a.png"], "cube.obj is a file, not a folder"),
    "the panorama": (["-o", "OUT/room/color.exr"], "color.exr: belongs to the scene"),
    "the same twice": (["--profile", "OUT/a.png"], "--profile OUT/a.png: is the picture's name"),
    "profile in place": (["--profile", "OUT/room/scene.toml"], "belongs to the scene"),
}


@pytest.mark.parametrize(("words", "message"), BAD_RENDERS.values(), ids=BAD_RENDERS)
def test_bad_renders(
    words: list[str], message: str, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    before = snapshot(tmp_path)
    given = [word.replace("OUT", str(tmp_path)) for word in words]
    output = [] if "-o" in words else ["-o", tmp_path / "a.png"]
    line = fails("render", scene, *output, *given)
    assert message.replace("OUT", str(tmp_path)) in line
    assert snapshot(tmp_path) == before


@pytest.mark.thorough
def test_pictures_larger_than_the_device_are_refused(
    scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    words = ["render", scene, "-o", tmp_path / "a.png", "--size", 16384, 16384]
    line = fails(*words, code=3)
    assert "16384 x 16384 pixels need" in line
    assert "lower --size" in line


@pytest.mark.parametrize("spec", ["zzz", "99:0", ""])
def test_unknown_devices_list_those_there_are(
    spec: str, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    line = fails("render", scene, "-o", tmp_path / "a.png", "--device", spec, code=3)
    assert "there are: 0:0 " in line


def test_a_bad_environment_variable_is_named(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[..., str]
) -> None:
    monkeypatch.setenv("PYOPENCL_CTX", "zzz")
    line = fails("render", scene, "-o", tmp_path / "a.png", code=3)
    assert "PYOPENCL_CTX='zzz' names no OpenCL device" in line
    assert "there are: 0:0 " in line


def test_compare_needs_truth_of_the_views_size(scene: Path, fails: Callable[..., str]) -> None:
    assert "no view has a truth to compare with" in fails("compare", scene)
    with (scene / "scene.toml").open("a") as file:
        file.write('truth = "truth.exr"\n')
    assert "views.ahead.truth: there is no file truth.exr" in fails("compare", scene)
    write_rgb(scene / "truth.exr", np.ones((8, 8, 3), np.float32))
    assert "truth.exr: 8x8 pixels, but views.ahead.size is 32x24" in fails("compare", scene)


BAD_ADDS: dict[str, tuple[list[str], str]] = {
    "sky": (["--look", "0", "60"], "the panorama has no depth at yaw 0, pitch 60 (sky, or a hole)"),
    "direction": (["--look", "0", "91"], "--look 0 91: expected -360 to 360 degrees"),
    "name taken": (["--look", "0", "-40", "--name", "cube"], "named 'cube' already"),
    "name with slash": (["--look", "0", "-40", "--name", "a/b"], "--name 'a/b': expected letters"),
    "name empty": (["--look", "0", "-40", "--name", ""], "--name '': expected letters"),
    "height": (["--look", "0", "-40", "--height", "nan"], "--height nan: expected metres"),
}


@pytest.mark.parametrize(("words", "message"), BAD_ADDS.values(), ids=BAD_ADDS)
def test_failing_to_add_leaves_the_scene_as_it_is(
    words: list[str], message: str, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    depth = box_room(64, 32)[0].astype(np.float32)
    depth[:14] = 0.0
    write_channels(scene / "depth.exr", Z=depth)
    (tmp_path / "m.obj").write_text(CUBE)
    before = snapshot(tmp_path)
    assert message in fails("scene", "add", scene, tmp_path / "m.obj", *words)
    assert snapshot(tmp_path) == before


def test_a_scene_that_is_missing_is_said_to_be(tmp_path: Path, fails: Callable[..., str]) -> None:
    (tmp_path / "m.obj").write_text(CUBE)
    line = fails("scene", "add", tmp_path / "none", tmp_path / "m.obj", "--look", "0", "-40")
    assert "none/scene.toml: no such file" in line
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("name", ["room", "file", "file/below", "taken"])
def test_failing_to_make_a_scene_loses_nothing(
    name: str, scene: Path, tmp_path: Path, fails: Callable[..., str]
) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "color.exr").write_text("mine")
    before = snapshot(tmp_path)
    pictures = ["--color", scene / "color.exr", "--depth", scene / "depth.exr"]
    assert str(tmp_path / name) in fails("scene", "new", tmp_path / name, *pictures)
    assert snapshot(tmp_path) == before


def test_a_full_disk_leaves_nothing_behind(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[..., str]
) -> None:
    def full(source: Path, target: Path) -> None:
        Path(target).write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("shutil.copyfile", full)
    before = snapshot(tmp_path)
    pictures = ["--color", scene / "color.exr", "--depth", scene / "depth.exr"]
    line = fails("scene", "new", tmp_path / "new", *pictures)
    assert "color.exr: cannot be written: No space left on device" in line
    assert snapshot(tmp_path) == before
    assert not (tmp_path / "new").exists()


def render_without_egl(scene: Path, picture: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A child whose EGL knows no vendor; a driver without GLVND does not read the variable."""
    words = ("--accumulate", "1", "--size", "32", "32", *words)
    return run_python(
        *("-m", "iprt", "render", str(scene), "-o", str(picture), *words),
        __EGL_VENDOR_LIBRARY_DIRS=str(picture.parent / "none"),
    )


@pytest.mark.thorough
def test_without_egl_rays_draw_the_objects(scene: Path, tmp_path: Path) -> None:
    result = render_without_egl(scene, tmp_path / "a.png")
    assert result.returncode == 0
    assert "OpenGL" not in result.stderr
    assert (tmp_path / "a.png").exists()


@pytest.mark.thorough
@pytest.mark.parametrize("needing", [["--method", "iprt2023"], ["--set", "gbuffer=gl"]])
def test_no_egl_is_one_line_with_the_command_that_installs_it(
    scene: Path, tmp_path: Path, needing: list[str]
) -> None:
    result = render_without_egl(scene, tmp_path / "a.png", *needing)
    if result.returncode == 0:
        pytest.skip("EGL here is not GLVND's")
    assert result.returncode == 3
    assert result.stderr.startswith("iprt: error: no OpenGL 3.3 context through EGL (")
    assert "apt-get install -y libegl1" in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "a.png").exists()


@pytest.mark.thorough
def test_an_interrupted_render_leaves_no_picture(scene: Path, tmp_path: Path) -> None:
    started = tmp_path / "started"
    code = (
        # A test run in the background of a shell ignores interrupts, and its children with it.
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        # Before there are threads.
        "signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))\n"
        "import sys; from pathlib import Path; from iprt import cli, renderer\n"
        "render = renderer.Renderer.render\n"
        "def marked(self, *args, **kwargs):\n"
        f"    Path({str(started)!r}).touch(); return render(self, *args, **kwargs)\n"
        "renderer.Renderer.render = marked\n"
        f"words = ['render', {str(scene)!r}, '-o', {str(tmp_path / 'a.png')!r}]\n"
        "cli.command([*words, '--accumulate', '1000000'])"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stderr=subprocess.PIPE, text=True
    ) as child:
        until(lambda: started.exists() or child.poll() is not None)
        child.send_signal(signal.SIGINT)
        _, error = child.communicate(timeout=DEADLINE_S)
    assert child.returncode == 130
    assert error == "iprt: interrupted\n"
    assert {path.name for path in tmp_path.iterdir()} == {"room", "started"}


def test_a_current_folder_that_was_deleted_is_one_line(tmp_path: Path) -> None:
    code = (
        "import os, sys; from iprt import cli\n"
        "os.rmdir(os.getcwd()); sys.exit(cli.main(['render', 'scene', '-o', 'a.png']))"
    )
    folder = tmp_path / "gone"
    folder.mkdir()
    result = run_python("-c", code, cwd=folder, PYTHONPATH=str(ROOT))
    assert result.returncode == 2
    assert result.stderr == "iprt: error: the current folder was deleted; go to another one\n"
