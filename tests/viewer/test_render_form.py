"""The form of a render: what it proposes, and what it says of wrong values."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.settings.presets import PRESETS
from iprt.viewer import render_queue
from iprt.viewer.engine import Engine
from iprt.viewer.render_fields import render_fields
from iprt.viewer.render_form import RenderForm
from tests.clips import write_clip
from tests.viewer.test_fields import Ui, by_key
from tests.viewer.turns import FEWEST
from tests.viewer.viewports import at_rest, until


@pytest.fixture
def ui(device: ComputeDevice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ui]:
    monkeypatch.setenv("XDG_PICTURES_DIR", str(tmp_path))
    waits = (sys.executable, "-c", "import time; time.sleep(600)")
    monkeypatch.setattr(render_queue, "COMMAND", waits)
    scene = Scene.open(write_clip(tmp_path / "clip", 4, first=2, size=(30, 17)))
    with Engine(scene, lambda: device, FEWEST) as engine:
        ui = Ui(engine)
        at_rest(ui.viewport)
        ui.viewport.go_to("ahead")
        yield ui
        ui.viewport.close()


@pytest.fixture
def form(ui: Ui) -> RenderForm:
    return RenderForm(ui)


def test_it_proposes_what_is_seen(ui: Ui, form: RenderForm) -> None:
    ui.engine.seek(3)
    assert (form.frames, form.size, form.accumulate) == (range(3, 4), (30, 17), 64)
    assert (form.file, form.problem) == ("clip-ahead-0001.png", "")
    form.quality = "final"
    assert form.accumulate == 2048
    form.what = "clip"
    assert (form.frames, form.quality, form.accumulate) == (range(2, 6), "accurate", 4)
    assert form.file == "clip-ahead-0001.mp4"
    assert "even sides" in form.problem
    ui.viewport.look(ui.viewport.view.resized(33, 19))
    ui.viewport.turn(5.0, 0.0)
    assert form.size == (32, 16), "of the window"
    assert (form.file, form.problem) == ("clip-view-0001.mp4", "")
    form.around = True
    assert (form.file, form.size) == ("clip-equirect-0001.mp4", (64, 32))
    form.resize(width=101)
    assert form.size == (100, 50)
    form.resize(height=24)
    assert form.size == (48, 24)


def test_a_view_that_moves_is_rendered_as_it_is_seen(form: RenderForm, ui: Ui) -> None:
    """Where the window does not follow it, a picture is of the window's direction."""
    path = ui.engine.scene.root / "scene.toml"
    keys = "".join(f"\n[[views.keyframes]]\ntime = {t}\nyaw_deg = {90 * t}\n" for t in (0, 1))
    path.write_text(path.read_text() + keys)
    until(ui.viewport, lambda _: ui.engine.scene.views["ahead"].motion is not None)
    ui.viewport.go_to("ahead")
    seen = form.order()
    assert (seen.name, seen.frames) == ("ahead", range(2, 3))
    ui.engine.seek(4)
    later = form.order()
    assert (later.name, later.view.yaw_deg, later.frames) == (None, 0.0, range(4, 5))
    form.what = "clip"
    assert form.order().name == "ahead"


def test_names_are_free(form: RenderForm, ui: Ui, tmp_path: Path) -> None:
    (tmp_path / "iprt").mkdir()
    (tmp_path / "iprt" / "clip-ahead-0001.mp4.parts").mkdir()
    assert form.file == "clip-ahead-0002.png"
    form.submit()
    assert form.file == "clip-ahead-0003.png"
    assert ui.engine.renders.open == ("clip-ahead-0002.png",)
    form.file = "clip-ahead-0002.png"
    form.submit()
    assert "is in the queue already" in form.problem
    assert form.file == "clip-ahead-0002.png", "it can be mended"
    old = tmp_path / "old.png"
    old.touch()
    form.file = str(old)
    form.submit()
    assert form.problem == f"{old}: exists already; name another file"
    old.unlink()
    form.submit()
    assert form.problem == ""
    assert len(ui.engine.renders.open) == 2


def test_the_format_is_the_end_of_the_name(form: RenderForm) -> None:
    form.file = "a.b_7.png"
    for ending, name in (
        (".exr", "a.b_7.exr"),
        (".%04d.png", "a.b_7.%04d.png"),
        (".mkv", "a.b_7.mkv"),
    ):
        form.ending = ending
        assert (form.file, form.ending) == (name, ending)
    form.file = "frame_%d.EXR"
    assert form.ending == ".%04d.exr"
    form.what = "range"
    assert form.file == "frame_%d.EXR"
    form.what = "frame"
    assert form.file == "frame.png"


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"width": 0}, "0 x 17 pixels: expected 1 to 16384"),
        ({"height": 20000}, "30 x 20000 pixels: expected 1 to 16384"),
        ({"accumulate": 0}, "0 view frames: expected 1"),
        ({"what": "range", "first": 1}, "frames 1 to 5: the video has 2 to 5"),
        ({"what": "range", "last": 6}, "frames 2 to 6: the video has 2 to 5"),
        ({"what": "range", "first": 4, "last": 3}, "frames 4 to 3: the video has 2 to 5"),
        ({"file": " "}, "name a file"),
        ({"file": "a.gif"}, "a.gif: unknown output format '.gif'"),
        ({"file": "~nobody-has-this-name/a"}, "unknown output format ''"),
        ({"file": "clip.mp4"}, "even sides"),
        ({"what": "clip", "file": "a.png"}, "4 frames are asked for; write a.%04d.png"),
        ({"what": "clip", "file": "%d-%d.png"}, "expected one %d"),
        ({"file": "../clip/depth.exr"}, "belongs to the scene"),
        ({"file": "../clip/cube.obj/a.png"}, "cube.obj is a file, not a folder"),
    ],
)
def test_wrong_values_are_told_at_once(
    values: dict[str, Any], told: str, ui: Ui, form: RenderForm
) -> None:
    fields = by_key(render_fields(ui, form))
    for key, value in values.items():
        fields[f"render {key}"].write(value)
    assert told in form.problem
    assert "\n" not in form.problem
    form.submit()
    assert told in form.problem
    assert ui.engine.renders.renders == ()


def test_choices_hold_what_can_be(ui: Ui, form: RenderForm) -> None:
    fields = by_key(render_fields(ui, form))

    def options(key: str) -> list[Any]:
        return list(fields[f"render {key}"].options())

    assert options("what") == ["frame", "clip", "range"]
    assert options("quality") == [None, *PRESETS]
    assert options("format") == [".png", ".exr"]
    form.file = "a.gif"
    assert options("format") == [".png", ".exr", ".gif"]
    form.file = "a.mp4"
    form.what = "clip"
    assert options("quality") == [None, "draft", "balanced", "accurate"]
    assert options("format") == [".mp4", ".mov", ".mkv", ".%04d.png", ".%04d.exr"]
    assert not fields["render first"].enabled()
    form.what = "range"
    assert fields["render first"].enabled()
