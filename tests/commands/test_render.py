"""`iprt render`: which view it asks the renderer for, what it writes, what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import OpenEXR
import pytest

from iprt.commands.job import Job
from iprt.commands.knobs import KnobFlags
from iprt.commands.render import render
from iprt.commands.views import choose_view, moving_view
from iprt.device.profile import PassTime, Profile
from iprt.errors import FormatError, IprtError
from iprt.film import view_at
from iprt.renderer import RenderedFrame
from iprt.scene.camera import View
from iprt.scene.scene import Scene
from iprt.settings import Settings, TraceSettings
from tests.clips import write_clip


class FakeProfile(Profile):
    def passes(self) -> list[PassTime]:
        return [PassTime("march", 3.0 * self.frames, 0.0, self.frames)]


class FakeFilm:
    """Pictures whose red channel is the number of view frames, and green the video frame's."""

    calls: list[tuple[Any, ...]]
    prepare_ms = 1.0

    def __init__(self, device: Any, settings: Settings, view: Any, accumulate: int) -> None:
        self.device, self.view, self.accumulate = device, view, accumulate
        self.settings = settings

    def __enter__(self) -> FakeFilm:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def frames(
        self,
        indices: Sequence[int],
        *,
        warm_up: int = 0,
        aovs: tuple[str, ...] = (),
        progress: Callable[[int], None],
    ) -> Iterator[tuple[int, RenderedFrame]]:
        self.calls.append((list(indices), warm_up, aovs, self.accumulate, self.settings))
        for index in indices:
            self.device.profile.frames += self.accumulate
            progress(self.accumulate)
            color = np.zeros((self.view.height, self.view.width, 3), np.float32)
            color[..., 0], color[..., 1] = self.accumulate, index
            layers = {"normal": color, "depth": np.full(color.shape[:2], 2.5, np.float32)}
            yield index, RenderedFrame(color, {name: layers[name] for name in aovs})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_clip(tmp_path / "room")


@pytest.fixture
def scene(folder: Path) -> Scene:
    return Scene.open(folder)


@pytest.fixture
def command(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """`iprt render` with a fake device and film."""
    monkeypatch.setattr(FakeFilm, "calls", [], raising=False)

    def compute(*_: object) -> SimpleNamespace:
        return SimpleNamespace(profile=FakeProfile(), name="a device")

    def film(job: Job, device: SimpleNamespace) -> FakeFilm:
        view = view_at(job.scene, job.view, 0)
        return FakeFilm(device, job.settings, view, job.accumulate)

    monkeypatch.setattr("iprt.device.choose.choose_device", lambda spec: spec)
    monkeypatch.setattr("iprt.device.compute.ComputeDevice", compute)
    monkeypatch.setattr("iprt.commands.video.ComputeDevice", compute)
    monkeypatch.setattr(Job, "film", film)
    return lambda *args, **kwargs: render(folder, *args, **kwargs)


def test_first_view_is_the_default(scene: Scene) -> None:
    assert choose_view(scene, None) == (View(32, 16, pitch_deg=-30.0), ("cube",))
    assert moving_view(scene, None) == (scene.views["ahead"], ("cube",))


def test_named_view_keeps_its_objects_in_another_size(scene: Scene) -> None:
    view, objects = choose_view(scene, "ahead", size=(8, 6))
    assert view == View(8, 6, pitch_deg=-30.0)
    assert objects == ("cube",)


def test_equirect_has_the_size_of_the_panorama(scene: Scene) -> None:
    assert choose_view(scene, "equirect") == (View(64, 32, projection="equirect"), None)
    assert choose_view(scene, "equirect", size=(10, 5))[0].width == 10


def test_own_view_shows_all_objects(scene: Scene) -> None:
    view, objects = moving_view(scene, None, yaw=-30.0, fov=90.0, size=(8, 6))
    assert view == View(8, 6, yaw_deg=-30.0, fov_y_deg=90.0)
    assert objects is None


def test_scene_without_views_is_seen_forward(scene: Scene) -> None:
    scene.views.clear()
    view, objects = choose_view(scene, None)
    assert (view.yaw_deg, view.pitch_deg, objects) == (0.0, 0.0, None)


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
        knobs=KnobFlags(set=("trace.rays=2",)),
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
    assert json.loads(profile.read_text())["passes"][0]["ms"] == 3.0
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
        ({"output": "a.exr", "knobs": KnobFlags(set=("trace.rays=0",))}, "--set trace.rays=0"),
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
