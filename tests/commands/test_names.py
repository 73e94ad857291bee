"""Outputs of any name: written as named, and printed as they are."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from iprt import cli
from iprt.errors import SceneError
from iprt.scene.scene import Scene
from tests.scene.files import CUBE, snapshot

ROOT = Path(__file__).parents[2]


WORDS = ("render", "room", "--method", "ibl", "--size", "16", "16", "--accumulate", "1")


@pytest.fixture
def render(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> Callable[..., tuple[int, bytes, bytes]]:
    """Render to an output; the exit code and what is printed."""
    monkeypatch.chdir(scene.parent)

    def run(output: bytes, *flags: str) -> tuple[int, bytes, bytes]:
        code = cli.main([*WORDS, *flags, "--output=" + os.fsdecode(output)])
        return code, *capsysbinary.readouterr()

    return run


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name",
    [
        b"d[/x]/o.png",
        b"out[final].png",
        b":smile:.png",
        b"two\nlines.png",
        b"100%.png",
        b"-o.png",
        b"12:30/o.mp4",
        b"file:[/b].mp4",
    ],
)
def test_outputs_of_any_name(
    name: bytes, scene: Path, render: Callable[..., tuple[int, bytes, bytes]]
) -> None:
    code, out, err = render(name)
    assert code == 0, err
    assert out == name + b"\n"
    assert os.path.getsize(os.path.join(os.fsencode(scene.parent), name)) > 0


@pytest.mark.thorough
def test_an_output_whose_name_is_no_text(scene: Path) -> None:
    """By the process, whose stdout passes such bytes on."""
    name = b"\xff\xfe.png"
    result = subprocess.run(
        [sys.executable, "-m", "iprt", *WORDS, b"--output=" + name],
        cwd=scene.parent,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout == name + b"\n"
    assert os.path.getsize(os.path.join(os.fsencode(scene.parent), name)) > 0


@pytest.mark.parametrize(
    "name",
    [
        b"x" * 300 + b".png",
        b"x" * 250 + b".mp4",
        b"room/cube.obj/\x1b[31mred.png",
        b"two\nlines.jpg",
    ],
)
def test_names_that_cannot_be_are_one_line(
    name: bytes, render: Callable[..., tuple[int, bytes, bytes]]
) -> None:
    code, out, err = render(name)
    assert code == 2
    assert err.startswith(b"iprt: error: ")
    assert err.endswith(b"\n")
    assert not set(err[:-1]) & {*range(32), 127}
    assert out == b""


def test_names_end_no_line_of_an_error_of_several(scene: Path, fails: Callable[..., str]) -> None:
    folder = scene.rename(scene.parent / "two\nlines")
    shown = f"{scene.parent}/two\\nlines/scene.toml: "
    manifest = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text("colour = 1\n" + manifest)
    assert fails("scene", "info", folder) == f"iprt: error: {shown}colour: unknown key\n"
    (folder / "scene.toml").write_text("colour = 1\ndeep = 2\n" + manifest)
    with pytest.raises(SceneError) as error:
        Scene.open(folder)
    assert error.value.lines == [
        f"{shown}2 problems",
        "  colour: unknown key",
        "  deep: unknown key",
    ]


@pytest.mark.thorough
def test_names_end_no_line_of_the_log(scene: Path) -> None:
    """The folder for compiled kernels that cannot be made is a warning."""
    result = subprocess.run(
        [sys.executable, "-m", "iprt", "scene", "check", scene],
        cwd=ROOT,
        env={**os.environ, "XDG_CACHE_HOME": "/proc/two\nlines"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0
    assert result.stderr.startswith("iprt: compiled kernels are not kept")
    assert "/proc/two\\nlines cannot be written" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("flag", ["--output", "--profile"])
@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_links_and_pipes_are_refused_before_anything_is_rendered(
    flag: str, kind: str, scene: Path, render: Callable[..., tuple[int, bytes, bytes]]
) -> None:
    name = "a.png" if flag == "--output" else "a.json"
    path = scene.parent / name
    if kind == "link":
        path.symlink_to("/dev/full")
    else:
        os.mkfifo(path)
    before = path.lstat().st_ino
    rest = [] if flag == "--output" else ["--profile", name]
    code, _, err = render(b"a.png", *rest)
    assert code == 2
    assert err.startswith(f"iprt: error: {name}: is a ".encode())
    assert err.count(b"\n") == 1
    assert path.lstat().st_ino == before
    assert {entry.name for entry in scene.parent.iterdir()} == {"room", name}


def test_a_scene_reached_by_a_link_to_its_file_is_not_changed(
    scene: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[..., str]
) -> None:
    (scene / "scene.toml").rename(scene / "shared.toml")
    (scene / "scene.toml").symlink_to("shared.toml")
    (scene.parent / "m.obj").write_text(CUBE)
    before = snapshot(scene.parent)
    monkeypatch.chdir(scene.parent)
    line = fails("scene", "add", "room", "m.obj", "--look", "0", "-40")
    assert "room/scene.toml: is a symbolic link" in line
    assert (scene / "scene.toml").is_symlink()
    assert snapshot(scene.parent) == before
