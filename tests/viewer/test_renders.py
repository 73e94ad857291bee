"""Renders from a viewer are the files that `iprt render` makes of the saved scene."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from iprt import cli
from iprt.device.compute import ComputeDevice
from iprt.files.images import read_color
from iprt.geometry.camera import View
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.settings.overrides import plain_values
from iprt.viewer.controls import with_preset
from iprt.viewer.engine import Engine
from iprt.viewer.render_form import RenderForm
from iprt.viewer.screenshots import default_folder
from tests.clips import write_clip
from tests.scene.files import CUBE
from tests.viewer.orders import ended, temporary
from tests.viewer.test_fields import Ui
from tests.viewer.turns import FEWEST
from tests.viewer.viewports import at_rest
from tests.waiting import until

DEVICE = os.environ.get("IPRT_TEST_DEVICE", "pocl")
TURNED = ["--yaw=20.0", "--pitch=-35.0", "--fov=50.0", "--size", "24", "20"]


@pytest.fixture
def ui(device: ComputeDevice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ui]:
    """Before a clip whose cube has been moved, and which is not saved yet."""
    scratch = temporary(tmp_path / "scratch", monkeypatch)
    monkeypatch.setenv("XDG_PICTURES_DIR", str(tmp_path / "Pictures"))
    scene = Scene.open(write_clip(tmp_path / "clip", 4))
    with Engine(scene, lambda: device, FEWEST, render_device=DEVICE) as engine:
        ui = Ui(engine)
        at_rest(ui.viewport)
        ui.viewport.go_to("ahead")
        move(engine, 0.4)
        yield ui
        ui.viewport.close()
    assert not list(scratch.iterdir())


def move(engine: Engine, x: float) -> None:
    place = engine.objects[0].to_world.copy()
    place[0, 3] = x
    engine.editor.place({"cube": place})


def submit(ui: Ui, form: RenderForm, name: str) -> Path:
    """Order a render to a file among the user's pictures."""
    path = default_folder() / name
    form.file = name
    form.submit()
    assert form.problem == ""
    return path


def rendered(ui: Ui, form: RenderForm, name: str) -> Path:
    path = submit(ui, form, name)
    states = ended(ui.engine.renders)
    assert states[name] == "finished", [render.problem for render in ui.engine.renders.renders]
    return path


def saved(ui: Ui) -> None:
    ui.save()
    until(lambda: not ui.engine.unsaved)


def by_command(ui: Ui, name: str, *flags: str, settings: Settings = FEWEST) -> Path:
    """The file that `iprt render` writes of the scene's folder."""
    scene = ui.engine.scene.root
    output, file = scene.parent / "command" / name, scene.parent / "settings.toml"
    values = plain_values(settings).items()
    file.write_text("\n".join(f"{key} = {json.dumps(value)}" for key, value in values))
    words = ["render", str(scene), "-o", str(output), *flags, "--settings", str(file)]
    assert cli.main([*words, "--device", DEVICE]) == 0
    return output


def same(*files: Path) -> bool:
    first, second = (file.read_bytes() for file in files)
    return first == second


def test_a_named_view_with_unsaved_edits(ui: Ui) -> None:
    """Also after an edit that comes later than the order; the scene's folder is left alone."""
    form, text = RenderForm(ui), (ui.engine.scene.root / "scene.toml").read_bytes()
    form.accumulate = 3
    ui.engine.seek(2)
    submit(ui, form, "moved.exr")
    move(ui.engine, -0.4)
    form.quality, form.accumulate = "draft", 2
    elsewhere = rendered(ui, form, "elsewhere.png")
    assert (ui.engine.scene.root / "scene.toml").read_bytes() == text
    assert len(list(ui.engine.scene.root.glob("[!.]*"))) == 7
    saved(ui)
    flags, draft = ["--frames", "2", "--accumulate", "2"], with_preset(FEWEST, "draft")
    assert same(elsewhere, by_command(ui, "elsewhere.png", *flags, settings=draft))
    move(ui.engine, 0.4)
    saved(ui)
    moved = by_command(ui, "moved.exr", "--frames", "2", "--accumulate", "3")
    assert same(default_folder() / "moved.exr", moved)
    assert not np.array_equal(read_color(moved), read_color(elsewhere))


def test_a_turned_view_and_the_panorama(ui: Ui) -> None:
    """A mesh that is added is seen, unless it is hidden."""
    ui.viewport.look(View(32, 16, 20.0, -35.0, 50.0))
    at_rest(ui.viewport)
    form = RenderForm(ui)
    form.accumulate = 2
    form.resize(width=24)
    form.resize(height=20)
    upload = ui.engine.scene.root.parent / "ball.obj"
    upload.write_text(CUBE)
    ui.add(upload, 0.5, 0.5)
    until(lambda: "ball" in ui.engine.unsaved)
    at_rest(ui.viewport)
    seen = rendered(ui, form, "seen.png")
    ui.show("ball", False)
    hidden = rendered(ui, form, "hidden.png")
    form.around = True
    form.resize(width=40)
    around = rendered(ui, form, "around.exr")
    ui.engine.editor.remove(["ball"])
    saved(ui)
    assert same(hidden, by_command(ui, "hidden.png", *TURNED, "--accumulate", "2"))
    whole = by_command(ui, "a.exr", "--view=equirect", "--size", "40", "20", "--accumulate", "2")
    assert same(around, whole)
    assert not np.array_equal(read_color(seen), read_color(hidden))


def test_a_range_of_a_video(ui: Ui) -> None:
    form = RenderForm(ui)
    form.what = "range"
    form.first, form.last, form.accumulate = 1, 2, 2
    video = rendered(ui, form, "range.mp4")
    saved(ui)
    flags = ["--frames", "1:2", "--accumulate", "2"]
    assert same(video, by_command(ui, "range.mp4", *flags))


def test_a_cancelled_clip_goes_on(ui: Ui) -> None:
    form, queue = RenderForm(ui), ui.engine.renders
    form.what = "clip"
    form.accumulate = 60
    first = submit(ui, form, "%d.png").with_name("0.png")
    until(first.exists)
    queue.cancel(queue.renders[0].number)
    until(lambda: not (first.parent / ".iprt.lock").exists())
    written = first.stat().st_mtime_ns
    assert not (first.parent / "3.png").exists()
    queue.again(queue.renders[0].number)
    assert ended(queue) == {"%d.png": "finished"}
    assert sorted(path.name for path in first.parent.iterdir()) == [f"{i}.png" for i in range(4)]
    assert first.stat().st_mtime_ns == written
