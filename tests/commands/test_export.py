"""`iprt export`: whole files or none, and every mistake is one line."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.files.images import read_color
from tests.scene.files import MANIFEST, OBJECT, VIEW, snapshot, write_scene

pytest.importorskip("pxr", reason="needs the extra `usd`")
from pxr import Usd


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return write_scene(tmp_path / "box")


def export(scene: Path, output: Path, *words: str) -> int:
    return cli.main(["export", str(scene), "-o", str(output), *words])


def test_a_stage_and_its_pictures(
    scene: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "new" / "box.usda"
    assert export(scene, output, "--size", "16", "8") == 0
    assert capfd.readouterr() == (f"{output}\n", "")
    pictures = output.parent / "box_pictures"
    assert sorted(output.parent.rglob("*")) == [output, pictures, pictures / "panorama.exr"]
    color = read_color(pictures / "panorama.exr")
    np.testing.assert_allclose(color, 0.5, rtol=1e-3)
    assert "@./box_pictures/panorama.exr@" in output.read_text()
    before = snapshot(output.parent)
    assert export(scene, output, "--size", "16", "8") == 0, "files are replaced"
    assert snapshot(output.parent) == before


def test_a_package_holds_its_pictures(scene: Path, tmp_path: Path) -> None:
    output = tmp_path / "new" / "box.usdz"
    assert export(scene, output, "--size", "16", "8") == 0
    assert list(output.parent.iterdir()) == [output]
    stage = Usd.Stage.Open(str(output))
    dome = stage.GetPrimAtPath("/box/captured/panorama").GetAttribute("inputs:texture:file")
    assert dome.Get().resolvedPath


@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("a.obj", (), "unknown format '.obj'; supported: .usd, .usda, .usdc, .usdz"),
        ("a.usda", ("--size", "2", "2"), "--size 2 2: expected 8 to 4096"),
        ("a.usda", ("--frame", "7"), "no frame 7; the scene has 0 to 0"),
        ("folder.usda", (), "is a folder"),
        ("link.usda", (), "is a symbolic link"),
        ("taken.usda", (), "taken_pictures: is no folder"),
        ("box/x/a.usda", (), "is a file, not a folder"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(
    scene: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    words: tuple[str, ...],
    said: str,
) -> None:
    (tmp_path / "folder.usda").mkdir()
    (tmp_path / "link.usda").symlink_to("a.usda")
    (tmp_path / "taken_pictures").touch()
    (scene / "x").touch()
    before = snapshot(tmp_path)
    assert export(scene, tmp_path / name, *words) == 2
    line = capsys.readouterr().err
    assert line.startswith("iprt: error: ")
    assert line.count("\n") == 1
    assert said in line
    assert snapshot(tmp_path) == before


def test_a_full_disk_leaves_nothing(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import iprt.output.usd.pictures as module

    def full(path: Path, *_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "write_exr", full)
    before = snapshot(tmp_path)
    assert export(scene, tmp_path / "out" / "a.usda") == 2
    assert "a.usda: cannot be written: No space left on device" in capsys.readouterr().err
    assert snapshot(tmp_path) == before
    assert not (tmp_path / "out").exists()


def test_inputs_of_the_scene_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = MANIFEST + OBJECT.replace("cube.obj", "cube.usda") + VIEW
    scene = write_scene(tmp_path / "box", manifest)
    (scene / "cube.usda").write_text("#usda 1.0\n")
    assert export(scene, scene / "cube.usda") == 2
    assert "belongs to the scene" in capsys.readouterr().err


def test_what_usd_does_not_have_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    glass = 'material = { kind = "dielectric", absorption = [1, 2, 3] }\n'
    scene = write_scene(tmp_path / "box", MANIFEST + OBJECT + glass + VIEW)
    assert export(scene, tmp_path / "a.usda", "--size", "16", "8") == 0
    assert "not written: absorption in glass" in caplog.text


def test_without_usd_one_line_names_the_extra(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert export(scene, tmp_path / "a.usda") == 2
    assert capsys.readouterr().err.endswith("pip install 'iprt[usd]'\n")
