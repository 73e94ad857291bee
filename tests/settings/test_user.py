"""Settings below the flags: of the user, the scene and the environment, and which of them win."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from iprt import cli
from iprt.errors import IprtError
from iprt.measure.protocol import scene_hash
from iprt.scene.scene import Scene
from iprt.settings.overrides import all_settings
from iprt.settings.user import environment_settings, user_file, user_settings, variable

Effective = Callable[..., dict[str, tuple[object, str]]]


@pytest.fixture
def user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the user's file, which is not there yet."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    file = tmp_path / "config" / "iprt" / "settings.toml"
    assert user_file() == file
    file.parent.mkdir(parents=True)
    return file


@pytest.fixture
def effective(capsys: pytest.CaptureFixture[str]) -> Effective:
    """Return value and source of the settings that `iprt settings --json` prints."""

    def run(*words: object) -> dict[str, tuple[object, str]]:
        capsys.readouterr()
        assert cli.main(["settings", "--json", *map(str, words)]) == 0
        found = json.loads(capsys.readouterr().out)["settings"]
        return {key: (entry["value"], entry["from"]) for key, entry in found.items()}

    return run


def with_settings(scene: Path, text: str) -> None:
    with (scene / "scene.toml").open("a") as file:
        file.write(f"\n[settings]\n{text}\n")


def test_each_layer_wins_over_those_below(
    scene: Path, user: Path, effective: Effective, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """One after the other is added; each names itself."""
    assert effective(scene)["light_scale"] == (1, "default")
    preset = ["--quality", "draft"]
    assert effective(scene, *preset)["light_scale"] == (4, "preset draft: light_scale")
    user.write_text("light_scale = 2")
    assert effective(scene, *preset)["light_scale"] == (2, f"{user}: light_scale = 2")
    with_settings(scene, "light_scale = 3")
    expected = (3, f"{scene}/scene.toml: light_scale = 3")
    assert effective(scene, *preset)["light_scale"] == expected
    assert effective(*preset)["light_scale"] == (2, f"{user}: light_scale = 2"), "without a scene"
    monkeypatch.setenv("IPRT_LIGHT_SCALE", "5")
    assert effective(scene, *preset)["light_scale"] == (5, "IPRT_LIGHT_SCALE=5")
    file = tmp_path / "own.toml"
    file.write_text("light_scale = 6")
    words = [*preset, "--settings", file]
    assert effective(scene, *words)["light_scale"] == (6, f"{file}: light_scale = 6")
    words += ["--set", "light_scale=7"]
    assert effective(scene, *words)["light_scale"] == (7, "--set light_scale=7")


def test_defaults_of_a_method_are_named(effective: Effective) -> None:
    found = effective("--set", "method=iprt2023")
    assert found["trace.bounces"] == (1, "default of iprt2023")


def test_the_table_says_where_files_are(
    user: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("IPRT_DEVICE", "somewhere")
    assert cli.main(["settings", "--where"]) == 0
    printed = capsys.readouterr().out
    assert all(key in printed for key in all_settings())
    assert "device: somewhere (IPRT_DEVICE)" in printed
    assert "settings.toml" in printed


def test_every_setting_has_a_variable_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    assert variable("trace.rays") == "IPRT_TRACE_RAYS"
    assert len({variable(key) for key in all_settings()}) == len(all_settings())
    assert "IPRT_DEVICE" not in {variable(key) for key in all_settings()}
    assert environment_settings() == []
    monkeypatch.setenv("IPRT_TRACE_RAYS", "")
    assert environment_settings() == []
    monkeypatch.setenv("IPRT_MASK_SPARSE", "false")
    monkeypatch.setenv("IPRT_METHOD", "ibl")
    assert {item.key: item.value for item in environment_settings()} == {
        "method": "ibl",
        "mask.sparse": False,
    }


def test_bad_values_name_their_source(
    scene: Path,
    user: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    fails: Callable[..., str],
) -> None:
    words = ["render", scene, "-o", tmp_path / "a.png"]
    with_settings(scene, "light_scale = 0")
    line = fails(*words)
    assert f"{scene}/scene.toml: light_scale = 0: expected a whole number from 1 to 8" in line
    monkeypatch.setenv("IPRT_LIGHT_SCALE", "many")
    assert "IPRT_LIGHT_SCALE=many: expected a whole number" in fails(*words)
    user.write_text("rais = 1")
    assert f"{user}: rais = 1: there is no setting 'rais'" in fails(*words)
    user.write_bytes(b"\xff")
    assert f"{user}: " in fails("settings")
    user.unlink()
    user.mkdir()
    with pytest.raises(IprtError, match="cannot be read"):
        user_settings()


def test_settings_of_a_scene_are_no_part_of_its_hash(scene: Path) -> None:
    before = scene_hash(Scene.open(scene))
    with_settings(scene, "light_scale = 3")
    assert scene_hash(Scene.open(scene)) == before
