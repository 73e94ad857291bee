"""Objects are copied from one scene, and pasted into another, with all that belongs to them."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.device.compute import ComputeDevice
from iprt.errors import FormatError, SceneError
from iprt.scene.clipboard import KEPT, KEPT_NS, OBJECTS, copied_objects, copy_objects
from iprt.scene.light_tables import PointTable
from iprt.scene.manifest import manifest_text
from iprt.scene.object_edits import ObjectEdit, flat
from iprt.scene.scene import Scene
from iprt.viewer.actions import actions
from iprt.viewer.engine import Engine
from tests.clips import write_clip
from tests.viewer.test_arranging import saved, states
from tests.viewer.turns import SETTINGS
from tests.viewer.viewports import Ui, at_rest, until

TEXTURED = '{ kind = "diffuse", albedo = [0.5, 1, 1], texture = "maps/tiles.png" }'
PLAIN = '{ kind = "plastic", albedo = [0.5, 0.3, 0.2], alpha = 0.2 }'
KEYS = "\n[[objects.keyframes]]\ntime = 1.0\ntranslation = [0.5, 0, 0]\n"


@pytest.fixture
def clipboard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "clipboard"
    monkeypatch.setattr("iprt.viewer.scene_editor.default_folder", lambda: folder)
    return folder


@pytest.fixture
def source(tmp_path: Path) -> Scene:
    """Its cube has a map, a material library, keyframes, and a light beside it."""
    folder = write_clip(tmp_path / "source", 1)
    (folder / "maps").mkdir()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (4, 4, 3), np.uint8)).save(
        folder / "maps/tiles.png"
    )
    (folder / "cube.mtl").write_text("newmtl m\nKd 1 0 0\n")
    mesh = folder / "cube.obj"
    mesh.write_text("mtllib cube.mtl\nusemtl m\n" + mesh.read_text())
    path = folder / "scene.toml"
    text = path.read_text().replace(PLAIN, TEXTURED)
    light = '[[objects]]\nname = "lamp"\nlight = { kind = "point", power = 2.0 }\nto_world = '
    light += f"{list(flat(np.eye(4)))}\n"
    path.write_text(text.replace("[[views]]", f"{KEYS}\n{light}\n[[views]]"))
    return Scene.open(folder)


@pytest.fixture
def other(device: ComputeDevice, tmp_path: Path) -> Iterator[Ui]:
    """A window on another scene."""
    scene = Scene.open(write_clip(tmp_path / "other", 1))
    with Engine(scene, lambda: device, SETTINGS) as engine:
        ui = Ui(engine)
        at_rest(ui.viewport)
        yield ui
        ui.viewport.close()


def copy_all(source: Scene, clipboard: Path, *edits: ObjectEdit) -> None:
    names = [table.name for table in source.manifest.objects]
    copy_objects(source, manifest_text(source.root / "scene.toml"), edits, names, clipboard)


def test_all_that_belongs_to_an_object_comes_along(
    source: Scene, clipboard: Path, other: Ui
) -> None:
    """Even if the scene that it came from is gone by then; it is saved with its files."""
    copy_all(source, clipboard)
    cube_at, lamp_at = (entry.motion.to_world[:3, 3] for entry in source.objects)
    shutil.rmtree(source.root)
    surface = other.viewport.picking.ground(0.5, 0.6, 0.0)
    assert surface is not None
    actions(other)["paste"].act()
    cube, lamp = states(other, "cube", "cube-2", "lamp")[1:]
    until(other.viewport, lambda _: bool(other.run_posted() or other.selected))
    assert other.selection.names == ("cube-2", "lamp")
    placed = [state.motion.to_world[:3, 3] for state in (cube, lamp)]
    np.testing.assert_allclose(placed[0] - placed[1], cube_at - lamp_at, atol=1e-9)
    both = zip((cube, lamp), placed, strict=True)
    corners = np.concatenate([state.box - state.to_world[:3, 3] + at for state, at in both])
    low, high = corners.min(axis=0), corners.max(axis=0)
    foot = 0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])
    np.testing.assert_allclose(foot, surface.point, atol=1e-6)
    scene = saved(other.engine)
    tables = {table.name: table for table in scene.manifest.objects}
    material = tables["cube-2"].material
    assert material is not None
    assert material.albedo == [0.5, 1.0, 1.0]  # type: ignore[union-attr]
    (image,) = material.maps.values()
    assert (scene.root / image).is_file()
    assert len(tables["cube-2"].keyframes) == 1
    assert tables["lamp"].light == PointTable(kind="point", power=2.0)
    own = {entry.name: entry for entry in scene.objects}["cube-2"]
    assert own.bound.materials[0].texture is not None


def test_unsaved_edits_are_copied(source: Scene, clipboard: Path) -> None:
    moved = np.diag([0.5, 0.5, 0.5, 1.0])
    moved[:3, 3] = 1.0, 2.0, 3.0
    copy_all(source, clipboard, ObjectEdit("cube", flat(moved)), ObjectEdit("lamp", removed=True))
    copied = copied_objects(clipboard, 1.0)
    (edit,) = copied.edits
    assert edit.to_world == flat(moved)
    np.testing.assert_allclose(copied.foot, (1.0, 1.5, 3.0))


def test_pasting_twice_gives_two_with_names_of_their_own(ui: Ui, clipboard: Path) -> None:
    actions(ui)["copy"].act()
    until(ui.viewport, lambda _: bool(ui.run_posted() or ui.said))
    assert ui.said == [("copied: cube", False)]
    for names in (("cube", "cube-2"), ("cube", "cube-2", "cube-3")):
        actions(ui)["paste"].act()
        states(ui, *names)
    meshes = [table.mesh for table in saved(ui.engine).manifest.objects]
    assert meshes == ["cube.obj", "meshes/cube.obj", "meshes/cube.obj"]


def test_an_empty_or_damaged_clipboard_is_said(source: Scene, clipboard: Path) -> None:
    with pytest.raises(SceneError, match="nothing is copied yet"):
        copied_objects(clipboard, 1.0)
    copy_all(source, clipboard)
    (place,) = clipboard.iterdir()
    text = (place / OBJECTS).read_text()
    for bad in ("nonsense", 'objects = "x"', text.replace("maps/", "../"), text + "\nx = 1\n"):
        (place / OBJECTS).write_text(bad)
        with pytest.raises(FormatError, match="damaged"):
            copied_objects(clipboard, 1.0)
    (place / OBJECTS).write_text(text)
    (place / "cube.obj").unlink()
    os.symlink("/etc/hostname", place / "cube.obj")
    with pytest.raises(FormatError, match="outside"):
        copied_objects(clipboard, 1.0)


def test_copies_are_kept_while_unsaved_objects_may_need_them(
    source: Scene, clipboard: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _ in range(KEPT + 2):
        copy_all(source, clipboard)
    assert len(list(clipboard.iterdir())) == KEPT + 2, "of this week"
    later = time.time_ns() + KEPT_NS
    monkeypatch.setattr(time, "time_ns", lambda: later)
    copy_all(source, clipboard)
    assert len(list(clipboard.iterdir())) == KEPT
