"""A sun that a scene declares, or that is found once and kept."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.footage import found_light
from iprt.footage.frame import Frame
from iprt.footage.outside_light import OutsideLight, SunChoice
from iprt.footage.sun import DISC_DEG, Sun
from iprt.scene.scene import Scene
from tests.scene.files import MANIFEST, write_scene

FOUND = Sun(np.array([0.6, 0.8, 0.0]), (21.58, 19.17, 16.08), correlation=0.52)
DECLARED = """
[video.sun]
direction = [3.0, 4.0, 0.0]
irradiance = [10.0, 9.0, 8.0]
angle_deg = 1.0
"""


@pytest.fixture
def searches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Sun | None]:
    """A cache of its own, and the results to come of looking for a sun."""
    results: list[Sun | None] = [FOUND]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def find(frame: Frame, choice: SunChoice, *, sky: bool) -> OutsideLight:
        assert sky
        assert frame.sun is None
        sun = results.pop(0) if choice == "auto" else choice
        return OutsideLight(sun, doubt="" if sun else "two directions fit")

    monkeypatch.setattr(found_light, "find_light", find)
    return results


def scene_with(folder: Path, video: str = "", text: str = "") -> Path:
    manifest = MANIFEST.replace("[video]", f"[video]\n{video}") + text
    return write_scene(folder, manifest, width=128)


def require_equal(one: Sun | None, other: Sun) -> None:
    assert one is not None
    np.testing.assert_allclose(one.direction, other.direction, rtol=1e-12)
    assert (one.irradiance, one.angle_deg) == (other.irradiance, other.angle_deg)


def test_there_may_be_none(tmp_path: Path, searches: list[Sun | None]) -> None:
    scene = Scene.open(scene_with(tmp_path / "a", 'sun = "none"'))
    assert scene.sun is None
    assert scene.frame().sun is None
    assert len(searches) == 1


def test_it_is_looked_for_once(tmp_path: Path, searches: list[Sun | None]) -> None:
    folder = scene_with(tmp_path / "a")
    for _ in range(2):
        require_equal(Scene.open(folder).frame().sun, FOUND)
    assert not searches


def test_that_there_is_none_is_kept_too(tmp_path: Path, searches: list[Sun | None]) -> None:
    searches[:] = [None]
    folder = scene_with(tmp_path / "a")
    assert Scene.open(folder).sun is None
    assert Scene.open(folder).sun is None


def test_a_declared_one_is_not_looked_for(tmp_path: Path, searches: list[Sun | None]) -> None:
    frame = Scene.open(scene_with(tmp_path / "a", text=DECLARED)).frame()
    require_equal(frame.sun, Sun(np.array([0.6, 0.8, 0.0]), (10.0, 9.0, 8.0), 1.0))
    assert len(searches) == 1


@pytest.mark.parametrize(
    ("given", "wrong"),
    [
        ("direction = [3.0, 4.0, 0.0]", "direction = [0.0, 0.0, 0.0]"),
        ("direction = [3.0, 4.0, 0.0]", "direction = [3.0, 4.0]"),
        ("irradiance = [10.0, 9.0, 8.0]", "irradiance = [10.0, -9.0, 8.0]"),
        ("irradiance = [10.0, 9.0, 8.0]", "irradiance = [nan, 9.0, 8.0]"),
        ("irradiance = [10.0, 9.0, 8.0]", ""),
        ("angle_deg = 1.0", "angle_deg = 0.0"),
        ("angle_deg = 1.0", "angel_deg = 1.0"),
    ],
)
def test_mistakes_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], given: str, wrong: str
) -> None:
    folder = scene_with(tmp_path / "a", text=DECLARED.replace(given, wrong))
    assert cli.main(["scene", "sun", str(folder)]) != 0
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert "sun" in lines[0]
    key = (wrong or given).split(" ")[0]
    assert key in lines[0]


def test_an_unknown_word_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = scene_with(tmp_path / "a", 'sun = "bright"')
    assert cli.main(["scene", "sun", str(folder)]) != 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "auto" in line
    assert "none" in line


def test_the_command_prints_what_a_scene_declares(
    tmp_path: Path, searches: list[Sun | None], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = scene_with(tmp_path / "a")
    assert cli.main(["scene", "sun", str(folder)]) == 0
    shown = capsys.readouterr().out
    assert tomllib.loads(shown)["video"]["sun"] == {
        "direction": [0.6, 0.8, 0.0],
        "irradiance": [21.6, 19.2, 16.1],
        "angle_deg": DISC_DEG,
    }
    declaring = scene_with(tmp_path / "b", text=shown)
    require_equal(Scene.open(declaring).sun, Sun(FOUND.direction, (21.6, 19.2, 16.1)))
    assert cli.main(["scene", "sun", str(folder), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["sun"]["irradiance"] == [21.6, 19.2, 16.1]


def test_the_command_tells_that_there_is_none(
    tmp_path: Path, searches: list[Sun | None], capsys: pytest.CaptureFixture[str]
) -> None:
    searches[:] = [None]
    assert cli.main(["scene", "sun", str(scene_with(tmp_path / "a"))]) == 0
    assert "no patch is surely lit by a sun: two directions fit" in capsys.readouterr().out


def test_the_scene_report_shows_it(
    tmp_path: Path, searches: list[Sun | None], capsys: pytest.CaptureFixture[str]
) -> None:
    """(0.6, 0.8, 0) is to the right and asin 0.8 high."""
    folder = scene_with(tmp_path / "a")
    assert cli.main(["scene", "info", str(folder)]) == 0
    (line,) = (x for x in capsys.readouterr().out.splitlines() if x.startswith("sun "))
    assert "53.1 degrees high, at azimuth 90.0" in line
    assert "correlation of 0.52" in line
    assert cli.main(["scene", "info", str(folder), "--json"]) == 0
    sun = json.loads(capsys.readouterr().out)["sun"]
    assert sun["irradiance"] == list(FOUND.irradiance)
    declaring = scene_with(tmp_path / "b", text=DECLARED)
    assert cli.main(["scene", "info", str(declaring)]) == 0
    assert "declared" in capsys.readouterr().out
    searches[:] = [None]
    assert cli.main(["scene", "info", str(scene_with(tmp_path / "c"))]) == 0
    assert "no sun     two directions fit\n" in capsys.readouterr().out
