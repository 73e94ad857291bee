"""What the verbs tell a new user: next steps that work, and JSON that is nothing else."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
import trimesh

from iprt import cli
from iprt.files.images import read_color
from iprt.scene.scene import Scene
from tests.scene.files import MANIFEST, write_rgb, write_scene


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return write_scene(tmp_path / "my room")


def test_the_next_step_is_a_command_that_runs(
    scene: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    ball = trimesh.creation.icosphere(1, 0.5)
    ball.visual.vertex_colors = np.full((len(ball.vertices), 4), 99, np.uint8)
    ball.export(tmp_path / "my ball.ply")
    assert (
        cli.main(["scene", "add", str(scene), str(tmp_path / "my ball.ply"), "--look", "0", "-40"])
        == 0
    )
    size, line = capsys.readouterr().out.splitlines()
    assert size.startswith("my ball: 0.39 x 0.39 x 0.39 m (width, height, depth); in its file 1 x ")
    program, *words = shlex.split(line.partition("next: ")[2])
    assert program == "iprt"
    monkeypatch.chdir(tmp_path)
    assert cli.main([*words, "--size", "24", "16", "--accumulate", "1"]) == 0
    assert (tmp_path / "my ball.png").is_file()


def test_flat_things_are_no_larger_than_others(scene: Path, tmp_path: Path) -> None:
    """Scaled to a height, a plate would be wider than the room."""
    trimesh.creation.box((1.0, 0.02, 0.5)).export(tmp_path / "plate.ply")
    words = ["scene", "add", str(scene), str(tmp_path / "plate.ply"), "--look", "0", "-40"]
    assert cli.main(words) == 0
    (plate,) = Scene.open(scene).instances_named(("plate",))
    distance = 1.3 / np.sin(np.deg2rad(40.0))
    assert plate.to_world[0, 0] == pytest.approx(0.2 * distance, rel=0.05)


@pytest.mark.parametrize(
    "words",
    [
        ["scene", "info", "SCENE"],
        ["scene", "check", "SCENE"],
        ["scene", "gloss", "SCENE"],
        ["settings", "SCENE"],
        ["bench", "SCENE", "--size", "24", "16", "--repeat", "1", "--set", "irradiance.rows=32"],
    ],
    ids=["info", "check", "gloss", "settings", "bench"],
)
def test_json_is_all_that_is_printed(
    words: list[str], scene: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    given = [str(scene) if word == "SCENE" else word for word in words]
    assert cli.main([*given, "--json"]) == 0
    captured = capfd.readouterr()
    assert isinstance(json.loads(captured.out), dict)
    assert captured.err == ""


def test_strict_makes_warnings_an_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whether they are printed as text or JSON; without it, they change nothing."""
    scene = write_scene(tmp_path / "empty", MANIFEST)
    assert cli.main(["scene", "check", str(scene), "--strict"]) == 0
    color = read_color(scene / "color.exr")
    color[3, 4] = np.nan
    write_rgb(scene / "color.exr", color)
    assert cli.main(["scene", "check", str(scene)]) == 0
    capsys.readouterr()
    assert cli.main(["scene", "check", str(scene), "--strict"]) == 1
    (warning,) = [
        line for line in capsys.readouterr().out.splitlines() if line.startswith("warning: ")
    ]
    assert cli.main(["scene", "check", str(scene), "--strict", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert [f"warning: {text}" for text in found["warnings"]] == [warning]
    assert (found["scene"], found["objects"], found["views"]) == ("box", 0, 0)


def test_what_is_made_is_told_as_json(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = ["--color", str(scene / "color.exr"), "--depth", str(scene / "depth.exr")]
    assert cli.main(["scene", "new", str(tmp_path / "own"), *files, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["folder"], found["frames"]) == (str(tmp_path / "own"), 1)
    assert "m" in found["place"]
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "box.ply")
    words = ["scene", "add", str(scene), str(tmp_path / "box.ply"), "--look", "0", "-40", "--json"]
    assert cli.main(words) == 0
    found = json.loads(capsys.readouterr().out)
    (box,) = Scene.open(scene).instances_named(("box",))
    assert (found["name"], found["view"]) == ("box", "box")
    low = (box.mesh.positions @ box.to_world[:3, :3].T + box.to_world[:3, 3])[:, 1].min()
    assert found["position"][1] == pytest.approx(low, abs=1e-4)
