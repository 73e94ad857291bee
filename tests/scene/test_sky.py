"""The sky behind a scene's windows, estimated once and kept."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.footage import found_light
from iprt.footage.frame import Frame
from iprt.footage.outside_light import OutsideLight, SunChoice
from iprt.footage.sky import Sky, node_directions
from iprt.scene.scene import Scene
from tests.scene.files import MANIFEST, write_scene

FOUND = Sky(np.where(node_directions()[:, 1:2] > -0.01, [0.5, 1.0, 1.5], 1.0), np.full(3, 0.1))


@pytest.fixture
def estimates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Sky | None]:
    """A cache of its own, and the results to come of looking for a sky."""
    results: list[Sky | None] = [FOUND]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def find(frame: Frame, choice: SunChoice, *, sky: bool) -> OutsideLight:
        assert frame.sky is None
        return OutsideLight(sky=results.pop(0) if sky else None)

    monkeypatch.setattr(found_light, "find_light", find)
    return results


def scene_with(folder: Path, video: str = "") -> Path:
    return write_scene(folder, MANIFEST.replace("[video]", f"[video]\n{video}"), width=128)


def test_it_is_estimated_once(tmp_path: Path, estimates: list[Sky | None]) -> None:
    folder = scene_with(tmp_path / "a")
    for _ in range(2):
        sky = Scene.open(folder).sky
        assert sky is not None
        np.testing.assert_array_equal(sky.gain, FOUND.gain)
    assert not estimates


def test_that_there_is_none_is_kept_too(tmp_path: Path, estimates: list[Sky | None]) -> None:
    estimates[:] = [None]
    folder = scene_with(tmp_path / "a")
    assert Scene.open(folder).sky is None
    assert Scene.open(folder).sky is None


def test_it_may_be_switched_off(tmp_path: Path, estimates: list[Sky | None]) -> None:
    for sun in ("auto", "none"):
        scene = Scene.open(scene_with(tmp_path / sun, f'sky = "none"\nsun = "{sun}"'))
        assert scene.sky is None
        assert scene.frame().sky is None
    assert len(estimates) == 1


def test_it_does_not_need_a_search_for_a_sun(tmp_path: Path, estimates: list[Sky | None]) -> None:
    assert Scene.open(scene_with(tmp_path / "a", 'sun = "none"')).sky is not None


def test_an_unknown_word_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["scene", "info", str(scene_with(tmp_path / "a", 'sky = "blue"'))]) != 0
    (line,) = capsys.readouterr().err.splitlines()
    for word in ("sky", "auto", "none"):
        assert word in line


def test_the_scene_report_shows_it(
    tmp_path: Path, estimates: list[Sky | None], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = scene_with(tmp_path / "a")
    assert cli.main(["scene", "info", str(folder)]) == 0
    (line,) = (x for x in capsys.readouterr().out.splitlines() if x.startswith("sky "))
    assert "0.51 ± 0.05, 1 ± 0.1, 1.49 ± 0.1" in line
    assert cli.main(["scene", "info", str(folder), "--json"]) == 0
    red, green, blue = json.loads(capsys.readouterr().out)["sky"]["factor"]
    assert (red, green, blue) == pytest.approx((0.5, 1.0, 1.5), abs=0.03)
