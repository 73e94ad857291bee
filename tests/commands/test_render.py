"""`iprt render`: which view it asks the renderer for, what it writes, what it refuses."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import OpenEXR
import pytest

from iprt.commands.knobs import KnobFlags
from iprt.commands.render import choose_view, render
from iprt.device.profile import PassTime, Profile
from iprt.errors import FormatError, IprtError
from iprt.scene.camera import View
from iprt.settings import Settings, TraceSettings


class FakeProfile(Profile):
    def passes(self) -> list[PassTime]:
        return [PassTime("march", 3.0 * self.frames, 0.0, self.frames)]


class FakeRenderer:
    """A picture whose red channel is the number of frames."""

    calls: list[tuple[Any, ...]]

    def __init__(self, device: Any, *rest: Any) -> None:
        self.calls.append(rest)
        self.device = device
        _, _, self.view, _ = rest

    def __enter__(self) -> FakeRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def render(
        self, frames: int, aovs: tuple[str, ...], progress: Callable[[int], None]
    ) -> SimpleNamespace:
        self.device.profile.frames = frames
        progress(frames)
        color = np.zeros((self.view.height, self.view.width, 3), np.float32)
        color[..., 0] = frames
        layers = {"normal": color, "depth": np.full(color.shape[:2], 2.5, np.float32)}
        return SimpleNamespace(color=color, aovs={name: layers[name] for name in aovs})


@pytest.fixture
def scene() -> Any:
    views = {
        "table": SimpleNamespace(view=View(30, 20, yaw_deg=10.0), objects=("bunny",)),
        "sofa": SimpleNamespace(view=View(16, 12, fov_y_deg=40.0), objects=("cow", "teapot")),
    }
    return SimpleNamespace(
        name="room",
        exposure=2.0,
        views=views,
        width=64,
        height=32,
        frame=lambda: "first frame",
        instances="all objects",
        instances_named=lambda names: names,
        require_not_ours=lambda path: None,
    )


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, scene: Any) -> Callable[..., int]:
    """`iprt render` with a fake scene, device and renderer."""

    def module(name: str, **members: Any) -> None:
        fake = ModuleType(name)
        vars(fake).update(members)
        monkeypatch.setitem(sys.modules, name, fake)

    device = SimpleNamespace(profile=FakeProfile(), name="a device", finish=lambda: None)
    monkeypatch.setattr(FakeRenderer, "calls", [], raising=False)
    module("iprt.memory", require_memory=lambda *_, **__: None)
    module("iprt.scene.scene", Scene=SimpleNamespace(open=lambda path, **_: scene))
    module("iprt.device.choose", choose_device=lambda spec: spec)
    module("iprt.device.compute", ComputeDevice=lambda spec, limit_s: device)
    module("iprt.renderer", Renderer=FakeRenderer)
    return lambda *args, **kwargs: render(Path("room"), *args, **kwargs)


def test_first_view_is_the_default(scene: Any) -> None:
    assert choose_view(scene, None) == (scene.views["table"].view, ("bunny",))


def test_named_view_keeps_its_objects_in_another_size(scene: Any) -> None:
    view, objects = choose_view(scene, "sofa", size=(8, 6))
    assert view == View(8, 6, fov_y_deg=40.0)
    assert objects == ("cow", "teapot")


def test_equirect_has_the_size_of_the_panorama(scene: Any) -> None:
    assert choose_view(scene, "equirect") == (View(64, 32, projection="equirect"), None)
    assert choose_view(scene, "equirect", size=(10, 5))[0].width == 10


def test_own_view_shows_all_objects(scene: Any) -> None:
    view, objects = choose_view(scene, None, yaw=-30.0, fov=90.0, size=(8, 6))
    assert view == View(8, 6, yaw_deg=-30.0, fov_y_deg=90.0)
    assert objects is None


def test_scene_without_views_is_seen_forward(scene: Any) -> None:
    scene.views.clear()
    view, objects = choose_view(scene, None)
    assert (view.yaw_deg, view.pitch_deg, objects) == (0.0, 0.0, None)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "tabel"}, "--view tabel: .*table, sofa, equirect"),
        ({"name": "table", "yaw": 0.0}, "leave out --yaw"),
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
def test_impossible_views_are_refused(arguments: dict[str, Any], message: str, scene: Any) -> None:
    with pytest.raises(IprtError, match=message) as error:
        choose_view(scene, arguments.pop("name"), **arguments)
    assert "\n" not in str(error.value)


def test_picture_says_how_it_was_made(
    command: Callable[..., int], scene: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
    assert FakeRenderer.calls == [("first frame", ("bunny",), scene.views["table"].view, settings)]
    view = json.loads(header["iprt:view"])
    assert (view["width"], view["yaw_deg"], view["objects"]) == (30, 10.0, ["bunny"])
    attributes = [header[f"iprt:{key}"] for key in ("scene", "seed", "frames", "device")]
    assert attributes == ["room", "7", "3", "a device"]
    assert header["iprt:version"]
    assert json.loads(profile.read_text())["passes"][0]["ms"] == 3.0
    printed = capsys.readouterr()
    assert "march" in printed.out
    assert printed.out.rstrip().endswith(str(output))
    assert "march" not in printed.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"output": "a.jpg"}, r"supported: \.exr, \.png"),
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
    assert FakeRenderer.calls == []
