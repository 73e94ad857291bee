"""A program that controls a viewer, and looks at its pictures."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from iprt.device.compute import ComputeDevice
from iprt.errors import IprtError
from iprt.files.exr import read_exr_color
from iprt.output.display import developed
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.viewer.lens import Lens
from iprt.viewer.program.control import Control
from tests.rendering import render
from tests.scene.files import CUBE
from tests.viewer.program.controls import SIZE, NoWindows, controlled
from tests.viewer.turns import FEWEST, SETTINGS, VIEW
from tests.waiting import ROOT, until

CLIP_FRAMES = 3


@pytest.fixture
def viewer(scene: Scene, device: ComputeDevice) -> Iterator[tuple[Control, NoWindows]]:
    with controlled(scene, device) as viewer:
        yield viewer


@pytest.fixture
def control(viewer: tuple[Control, NoWindows]) -> Control:
    return viewer[0]


def test_the_picture_is_the_one_of_a_renderer_alone(
    control: Control, scene: Scene, device: ComputeDevice
) -> None:
    """As a program places the object, in another frame, with other settings and a size."""
    control.place("cube", (0.2, -1.0, -1.4), rotation=(0.0, 30.0, 0.0), size=0.8)
    control.seek(2)
    control.set("trace.rays=2")
    control.look(yaw=5.0, fov=50.0)
    picture = control.picture((24, 16), frames=2)
    assert (picture.dtype, picture.shape) == (np.float32, (16, 24, 3))
    about_y, size = np.deg2rad(30.0), 0.8 / 2.0  # the cube's side is 2
    (cube,) = scene.instances
    cos, sin = size * np.cos(about_y), size * np.sin(about_y)
    to_world = np.array(
        [[cos, 0, sin, 0.2], [0, size, 0, -1.0 + size], [-sin, 0, cos, -1.4], [0, 0, 0, 1]]
    )
    moved = replace(cube, to_world=to_world)
    settings = SETTINGS.model_copy(
        update={"trace": SETTINGS.trace.model_copy(update={"rays": 2}), "fading": 0.0}
    )
    view = replace(VIEW, width=24, yaw_deg=5.0, fov_y_deg=50.0)
    wanted = render(device, scene.frame(2), [moved], view, settings, frames=2).color
    np.testing.assert_allclose(picture, wanted, atol=1e-5)
    without = render(device, scene.frame(2), [], view, settings, frames=2).color
    assert np.abs(picture - without).max() > 0.05


def test_objects_are_added_painted_hidden_removed_and_brought_back(
    control: Control, tmp_path: Path
) -> None:
    def picture() -> np.ndarray[Any, Any]:
        return control.picture(SIZE, frames=1)

    before = picture()
    mesh = tmp_path / "block.obj"
    mesh.write_text(CUBE)
    name = control.add(mesh, yaw=20.0, pitch=-40.0, height=0.4, material="diffuse:0.8,0.1,0.1")
    assert name == "block"
    added = picture()
    assert np.abs(added - before).max() > 0.05
    control.paint("block", {"kind": "diffuse", "albedo": [0.0, 0.8, 0.0]})
    painted = picture()
    assert (painted - added)[..., 0].min() < -0.02
    control.show("block", False)
    np.testing.assert_array_equal(picture(), before)
    control.show("block")
    np.testing.assert_array_equal(picture(), painted)
    control.remove("block")
    np.testing.assert_array_equal(picture(), before)
    control.undo()
    control.place("block", size=0.2)  # it is there at once
    control.undo()
    np.testing.assert_array_equal(picture(), painted)
    assert control.status()["unsaved"] == ["block"]
    assert set(control.status()["objects"]) == {"cube", "block"}


def test_files_that_a_program_writes_are_followed(control: Control, scene: Scene) -> None:
    control.picture(SIZE, frames=1)
    manifest = scene.root / "scene.toml"
    text = manifest.read_text()
    manifest.write_text(text.replace("0.3, 0, 0, 0.1", "0.3, 0, 0, 0.5"))
    until(lambda: control.status()["objects"]["cube"]["position"][0] == 0.5)
    control.place("cube", (0.0, -1.0, -1.6))
    control.save()
    assert control.status()["unsaved"] == []
    assert Scene.open(scene.root).instances[0].to_world[0, 3] == pytest.approx(0.0)
    manifest.write_text("format = ")
    until(lambda: any("scene.toml" in line for line in control.status()["problems"]))


def test_files_are_as_displayed_or_linear(control: Control, tmp_path: Path) -> None:
    control.display(exposure=1.0, curve="filmic")
    picture = control.picture(SIZE, frames=1)
    png, exr = tmp_path / "a.png", tmp_path / "a.exr"
    control.render(png, SIZE, frames=1)
    control.render(exr, SIZE, frames=1)
    with Image.open(png) as image:
        assert "iprt:settings" in image.info
        np.testing.assert_array_equal(np.array(image), developed(picture, 2.0, "filmic"))
    np.testing.assert_array_equal(read_exr_color(exr), picture)


def test_later_windows_begin_where_a_program_looks(viewer: tuple[Control, NoWindows]) -> None:
    control, windows = viewer
    control.look(yaw=30.0, pitch=-10.0)
    control.display(buffer="depth")
    control.display(split=0.25)
    start = windows.start
    assert (start.view.yaw_deg, start.view.pitch_deg, start.view.fov_y_deg) == (30.0, -10.0, 60.0)
    assert start.lens == Lens(buffer="depth", split=0.25)
    control.look("ahead")
    control.display(buffer="none")
    assert (windows.start.view.yaw_deg, windows.start.view.pitch_deg) == (0.0, -30.0)
    assert windows.start.lens == Lens(split=0.25)
    control.set(FEWEST, {"trace.bounces": 3}, "seed=5")
    engine = control._engine
    trace = FEWEST.trace.model_copy(update={"bounces": 3})
    assert engine.world.settings == FEWEST.model_copy(update={"trace": trace, "seed": 5})


def test_a_viewer_is_left_only_without_unsaved_edits(viewer: tuple[Control, NoWindows]) -> None:
    control, windows = viewer
    control.remove("cube")
    with pytest.raises(IprtError, match="edits are not saved: cube"):
        control.quit()
    assert not windows.left
    control.quit(discard=True)
    assert windows.left


Call = Callable[[Control], object]
WRONG: list[tuple[Call, str]] = [
    (lambda c: c.look(), "look: give the name of a view"),
    (lambda c: c.look("ahead", yaw=1.0), "look: give the name of a view, or any of"),
    (lambda c: c.look("behind"), "no view is named 'behind'; the views are: ahead"),
    (lambda c: c.look(yaw=400.0), "look: yaw: expected less than or equal to 360, got 400"),
    (lambda c: c.look(pitch="up"), "look: pitch: expected a valid number"),  # type: ignore[arg-type]
    (lambda c: c.place("pot"), "no object is named 'pot'; the objects are: cube"),
    (lambda c: c.place("cube", (0.0, float("nan"), 0.0)), r"place: position\[1\]: expected a fin"),
    (lambda c: c.place("cube", size=-1.0), "place: size: expected greater than 0"),
    (lambda c: c.place("cube", to_world=[0.0] * 16), "cube"),
    (lambda c: c.paint("cube", "gold"), "--material gold: expected diffuse:R,G,B"),
    (lambda c: c.paint("cube", {"kind": "plastic"}), "material.albedo: required key is missing"),
    (lambda c: c.paint("cube", {"kind": "diffuse", "albedo": [1, 2, 0]}), r"material.albedo\[1\]"),
    (lambda c: c.add(Path("a.txt")), "a.txt: not a mesh"),
    (lambda c: c.add(Path("a.obj")), "a.obj: no such file"),
    (lambda c: c.set("trace.steps=32"), "there is no setting 'trace.steps'"),
    (lambda c: c.set("trace.rays=many"), "set trace.rays=many: expected a whole number"),
    (lambda c: c.set(3), "set: "),  # type: ignore[arg-type]
    (lambda c: c.display(buffer="x"), "display: buffer 'x': expected one of none, background"),
    (lambda c: c.display(curve="x"), "display: curve: expected 'srgb' or 'filmic'"),  # type: ignore[arg-type]
    (lambda c: c.render(Path("a.gif")), "a.gif: unknown output format"),
    (lambda c: c.picture((0, 5)), r"picture: size\[0\]: expected greater than or equal to 1"),
    (lambda c: c.picture(SIZE, frames=10_000, timeout=0.01), "the picture: not finished in time"),
    (lambda c: c.picture(SIZE, steps=3), "picture: steps: Unexpected"),  # type: ignore[call-arg]
]


def test_wrong_arguments_are_one_line_and_change_nothing(control: Control) -> None:
    control.picture(SIZE, frames=1)
    world = control._engine.world
    for call, words in WRONG:
        with pytest.raises(IprtError, match=words) as caught:
            call(control)
        assert "\n" not in str(caught.value)
    assert control._engine.world == world


def test_what_cannot_be_read_is_told(control: Control, scene: Scene, tmp_path: Path) -> None:
    broken = tmp_path / "broken.ply"
    broken.write_text("ply\n")
    with pytest.raises(IprtError, match=r"broken\.ply"):
        control.add(broken)
    with pytest.raises(IprtError, match="belongs to the scene"):
        control.render(scene.root / "color.0000.exr", SIZE)
    control.play()
    with pytest.raises(IprtError, match="the video plays; pause it"):
        control.picture(SIZE)
    control.pause()
    control.set(Settings())
    control._engine.close()
    with pytest.raises(IprtError, match="the viewer was closed"):
        control.picture(SIZE)


def test_the_page_of_the_docs_is_true(
    control: Control, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its methods, one after another, as they are written there."""
    page = (ROOT / "docs" / "viewer_program.md").read_text()
    _, block = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    *lines, last = block.replace("640, 480", "32, 16").splitlines()
    assert last == "viewer.close()"
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box().export("pot.glb")
    names: dict[str, Any] = {"viewer": control}
    exec("\n".join(lines), names)
    assert names["picture"].shape == (16, 32, 3)
    assert control.status()["objects"]["pot"]["position"] == [0.5, -1.2, -2.0]
    assert control.status()["unsaved"] == []
    assert (tmp_path / "pot.png").is_file()
