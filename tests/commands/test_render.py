"""`iprt render`: which view it asks the renderer for, what it writes, what it refuses."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import OpenEXR
import pytest

from iprt.commands.setting_flags import SettingFlags
from iprt.commands.views import choose_view, moving_view
from iprt.errors import FormatError, IprtError
from iprt.files.progress_line import ProgressLine
from iprt.geometry.camera import View
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.settings.overrides import changed
from iprt.settings.presets import PRESETS
from iprt.settings.trace import TraceSettings
from tests.commands.conftest import FakeFilm


@pytest.fixture
def scene(folder: Path) -> Scene:
    return Scene.open(folder)


def test_first_view_is_the_default(scene: Scene) -> None:
    view, (cube,) = choose_view(scene, None)
    assert (view, cube.name) == (View(32, 16, pitch_deg=-30.0), "cube")
    assert moving_view(scene, None) == (scene.views["ahead"], ("cube",))


def test_named_view_keeps_its_objects_in_another_size(scene: Scene) -> None:
    view, (cube,) = choose_view(scene, "ahead", size=(8, 6))
    assert (view, cube.name) == (View(8, 6, pitch_deg=-30.0), "cube")


def test_equirect_has_the_size_of_the_panorama(scene: Scene) -> None:
    view, instances = choose_view(scene, "equirect")
    assert (view, instances) == (View(64, 32, projection="equirect"), scene.instances)
    assert choose_view(scene, "equirect", size=(10, 5))[0].width == 10


def test_own_view_shows_all_objects(scene: Scene) -> None:
    view, objects = moving_view(scene, None, yaw=-30.0, fov=90.0, size=(8, 6))
    assert view == View(8, 6, yaw_deg=-30.0, fov_y_deg=90.0)
    assert objects is None


def test_scene_without_views_is_seen_forward(scene: Scene) -> None:
    scene.views.clear()
    view, instances = choose_view(scene, None)
    assert (view.yaw_deg, view.pitch_deg, instances) == (0.0, 0.0, scene.instances)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "tabel"}, "--view tabel: .*ahead, equirect"),
        ({"name": "ahead", "yaw": 0.0}, "leave out --yaw"),
        ({"name": None, "size": (0, 5)}, "--size 0 5"),
        ({"name": None, "size": (5, -1)}, "--size 5 -1"),
        ({"name": None, "size": (16385, 5)}, "--size 16385 5: expected 1 to 16384"),
        ({"name": None, "fov": 1.0}, "--fov 1"),
        ({"name": None, "fov": 179.0}, "--fov 179"),
        ({"name": None, "fov": float("nan")}, "--fov nan"),
        ({"name": None, "yaw": float("inf")}, "--yaw inf"),
        ({"name": None, "pitch": float("nan")}, "--pitch nan"),
        ({"name": None, "pitch": -90.5}, "--pitch -90.5"),
    ],
)
def test_impossible_views_are_refused(
    arguments: dict[str, Any], message: str, scene: Scene
) -> None:
    with pytest.raises(IprtError, match=message) as error:
        moving_view(scene, arguments.pop("name"), **arguments)
    assert "\n" not in str(error.value)


def test_picture_says_how_it_was_made(
    command: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output, profile = tmp_path / "a.exr", tmp_path / "profile.json"
    status = command(
        output=output,
        setting_flags=SettingFlags(set=("trace.rays=2",)),
        accumulate=3,
        seed=7,
        method="ibl",
        aov=("depth",),
        profile=profile,
    )
    assert status == 0
    with OpenEXR.File(str(output), separate_channels=True) as file:
        header, channels = dict(file.header()), file.channels()
        assert set(channels) == {"R", "G", "B", "depth.Z"}
        assert channels["R"].pixels[0, 0] == 3.0
    settings = Settings(method="ibl", seed=7, fading=0.0, trace=TraceSettings(rays=2))
    assert Settings.model_validate_json(header["iprt:settings"]) == settings
    assert FakeFilm.calls == [([0], 0, ("depth",), 3, settings)]
    view = json.loads(header["iprt:view"])
    assert (view["width"], view["pitch_deg"], view["objects"]) == (32, -30.0, ["cube"])
    attributes = [header[f"iprt:{key}"] for key in ("scene", "seed", "frames", "device")]
    assert attributes == ["clip", "7", "3", "a device"]
    assert header["iprt:version"]
    assert json.loads(profile.read_text())["passes"][0]["timing"]["ms"] == 3.0
    printed = capsys.readouterr()
    assert "march" in printed.out
    assert printed.out.rstrip().endswith(str(output))
    assert "march" not in printed.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"output": "a.jpg"}, r"supported: \.exr, \.png, and for video \.mp4, \.mov, \.mkv"),
        ({"output": "a.png", "aov": ("depth",)}, r"write an \.exr"),
        ({"output": "a.exr", "accumulate": 0}, "--accumulate 0"),
        (
            {"output": "a.exr", "setting_flags": SettingFlags(set=("trace.rays=0",))},
            "--set trace.rays=0",
        ),
        ({"output": "a.exr", "seed": -1}, "--seed -1"),
        ({"output": "a.exr", "view": "nowhere"}, "--view nowhere"),
        ({"output": "a.exr", "aov": ("wrmth",)}, "--aov wrmth: no such layer.*normal"),
    ],
)
def test_bad_values_are_refused_before_rendering(
    arguments: dict[str, Any], message: str, command: Callable[..., int], tmp_path: Path
) -> None:
    arguments["output"] = tmp_path / arguments["output"]
    with pytest.raises((IprtError, FormatError), match=message):
        command(**arguments)
    assert FakeFilm.calls == []


def final(command: Callable[..., int], output: Path, **given: Any) -> dict[str, Any]:
    """The header of a picture of quality final."""
    assert command(output=output, setting_flags=SettingFlags(quality="final"), **given) == 0
    with OpenEXR.File(str(output)) as file:
        return dict(file.header())


def test_final_goes_on_until_the_picture_has_converged(
    command: Callable[..., int], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "iprt.render"):
        header = final(command, tmp_path / "a.exr")
    assert 0.0 < float(header["iprt:noise"]) <= 0.001
    frames = int(header["iprt:frames"])
    assert frames in (4, 8, 16, 32, 64, 128, 256)
    (line,) = [record for record in caplog.records if record.name == "iprt.render"]
    assert line.levelname == "INFO"
    assert f"after {frames} frames" in line.getMessage()
    assert FakeFilm.calls[-1][-1] == changed(Settings(fading=0.0), PRESETS["final"])


def test_final_ends_at_accumulate_and_says_so(
    command: Callable[..., int], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    header = final(command, tmp_path / "a.exr", accumulate=3)
    assert header["iprt:frames"] == "3"
    assert float(header["iprt:noise"]) > 0.001
    (record,) = [record for record in caplog.records if record.name == "iprt.render"]
    assert record.levelname == "WARNING"
    assert "raise --accumulate" in record.getMessage()


def test_final_is_for_pictures(command: Callable[..., int], tmp_path: Path) -> None:
    with pytest.raises(IprtError, match="--quality final: is for a picture"):
        command(output=tmp_path / "a.mp4", setting_flags=SettingFlags(quality="final"))
    assert FakeFilm.calls == []


@pytest.mark.parametrize(("name", "total"), [("a.png", 3), ("a%d.png", 6)])
def test_progress_is_told_by_lines(
    name: str,
    total: int,
    command: Callable[..., int],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """View frames of a still, frames of a video."""
    assert command(output=tmp_path / name, accumulate=3, progress="lines") == 0
    lines = [ProgressLine.of(line) for line in capsys.readouterr().err.splitlines()]
    told = [line for line in lines if line is not None]
    assert told[0] == ProgressLine(0, total)
    assert told[-1] == ProgressLine(total, total)
    done = [line.done for line in told]
    assert done == sorted(done)
