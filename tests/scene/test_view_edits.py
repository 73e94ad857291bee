"""Edits of views and keyframes: what is written is what was edited, and comments stay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.geometry.keyframes import ObjectKeyframe, ViewKeyframe
from iprt.scene.edit_writing import NewFiles, edited_text, save_edits
from iprt.scene.light_edits import UNEDITED
from iprt.scene.manifest import parse_manifest
from iprt.scene.object_edits import ObjectEdit, edited_objects, flat
from iprt.scene.objects import objects_at
from iprt.scene.scene import Scene
from iprt.scene.view_edits import ViewEdit, edited_views, views_besides
from iprt.scene.view_reading import view_edits
from tests.scene.files import MANIFEST, VIEW, write_rgb, write_scene

PLACE = flat(np.eye(4))
OBJECT = f"""
[[objects]]
name = "cube"
mesh = "cube.obj"
to_world = {list(PLACE)}  # here

# It goes up,
[[objects.keyframes]]
time = 0.0  # from here
translation = [0, 0.10, 0]

[[objects.keyframes]]  # and turns.
time = 0.5
translation = [0, 1, 0]
rotation = [0, 0.7071, 0, 0.7071]  # by a quarter
interpolation = "smooth"

[[objects.keyframes]]
time = 1  # the last
scale = 2
"""
OTHER = """
[[views]]
name = "true"  # to compare
size = [32, 24]
objects = ["cube"]
truth = "truth.exr"
"""
PAN = (
    ViewKeyframe(time=0.0, yaw_deg=350.0, pitch_deg=-10.0),
    ViewKeyframe(time=2.0, yaw_deg=370.0, fov_y_deg=40.0, interpolation="smooth"),
)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    folder = write_scene(tmp_path / "s", MANIFEST + OBJECT + VIEW + OTHER)
    write_rgb(folder / "truth.exr", np.ones((24, 32, 3), np.float32))
    return Scene.open(folder)


def text(scene: Scene) -> str:
    return (scene.root / "scene.toml").read_text()


def keys(scene: Scene) -> tuple[ObjectKeyframe, ...]:
    return scene.objects[0].motion.keyframes


def test_untouched_keys_keep_their_text(scene: Scene) -> None:
    """And moved ones their comments."""
    save_edits(scene, (), views=[ViewEdit("true", removed=True)])
    before, (first, second, third) = text(scene), keys(scene)
    save_edits(scene, [ObjectEdit("cube", keyframes=(first, second, third))])
    assert text(scene) == before
    later = third.model_copy(update={"time": 1.25})
    save_edits(scene, [ObjectEdit("cube", keyframes=(first, second, later))])
    assert text(scene) == before.replace("time = 1  # the last", "time = 1.25  # the last")
    held = second.model_copy(update={"interpolation": "step"})
    save_edits(scene, [ObjectEdit("cube", keyframes=(first, held, later))])
    after = text(scene)
    assert 'interpolation = "step"' in after
    assert "rotation = [0, 0.7071, 0, 0.7071]  # by a quarter" in after
    save_edits(scene, [ObjectEdit("cube", keyframes=(first,))])
    assert "# from here" in text(scene)
    assert "# the last" not in text(scene)
    save_edits(scene, [ObjectEdit("cube", keyframes=())])
    assert "keyframes" not in text(scene)
    assert f"to_world = {list(PLACE)}  # here" in text(scene)


@pytest.mark.parametrize("new", [False, True])
def test_keys_of_objects_are_read_again(scene: Scene, new: bool) -> None:
    """Those of copies too."""
    first, second, third = keys(scene)
    turned = second.model_copy(update={"rotation": [0.36, 0.48, 0.0, 0.8], "time": 1 / 24})
    changed = (first, turned, third.model_copy(update={"scale": [1.0, 2.0, 3.0]}))
    edit = ObjectEdit("cube", keyframes=changed)
    if new:
        edit = ObjectEdit("cube-2", keyframes=changed, copy_of="cube", to_world=PLACE)
    shown = edited_objects(scene.objects, [edit], 100.0)
    save_edits(scene, [edit])
    read = Scene.open(scene.root).objects
    assert len(read) == len(shown) == 1 + new
    for time in (0.0, 1 / 24, 0.3, 0.75, 1.0):
        for one, other in zip(objects_at(shown, time), objects_at(read, time), strict=True):
            np.testing.assert_allclose(other.to_world, one.to_world, atol=1e-8)
    assert read[-1].motion.keyframes[0] == first
    assert read[-1].motion.keyframes[1].time == 1 / 24


def test_views_are_added_renamed_turned_and_removed(scene: Scene) -> None:
    look = View(40, 30, 12.5, -7.25, 45.0)
    edits = (
        ViewEdit("ahead", new_name="pan", keyframes=PAN, look=look),
        ViewEdit("true", removed=True),
        ViewEdit("new", look=look, new=True, objects=("cube",), keyframes=PAN[:1]),
        ViewEdit("gone", look=look, new=True, removed=True),
    )
    shown = edited_views(scene.views, edits, ("cube",))
    save_edits(scene, (), views=edits)
    read = Scene.open(scene.root).views
    assert list(read) == list(shown) == ["pan", "new"]
    for name, entry in shown.items():
        for time in (0.0, 0.7, 3.0):
            assert read[name].at(time) == entry.at(time)
        assert read[name].objects == entry.objects
    assert read["pan"].view.width == scene.views["ahead"].view.width


def test_truths_of_turned_views_are_outdated(scene: Scene) -> None:
    save_edits(scene, (), views=[ViewEdit("true", new_name="same")])
    assert not Scene.open(scene.root).views["same"].truth_outdated
    assert 'name = "same"  # to compare' in text(scene)
    for edit in (
        ViewEdit("same", look=View(1, 1, 3.0)),
        ViewEdit("same", keyframes=PAN),
    ):
        before = text(scene)
        save_edits(Scene.open(scene.root), (), views=[edit])
        assert Scene.open(scene.root).views["same"].truth_outdated
        (scene.root / "scene.toml").write_text(before)


def test_renamed_and_removed_objects_leave_new_views_valid(scene: Scene) -> None:
    view = ViewEdit("new", look=View(40, 30), new=True, objects=("cube",))
    renamed = (
        ObjectEdit("cube", removed=True),
        ObjectEdit("die", copy_of="cube"),
    )
    save_edits(scene, renamed, views=[view])
    assert Scene.open(scene.root).views["new"].objects == ("die",)


def test_what_is_left_after_saving() -> None:
    saved = ViewEdit("old", new_name="new", look=View(4, 3, 5.0))
    assert views_besides([saved], [saved]) == ()
    more = replace(saved, keyframes=PAN)
    assert views_besides([more], [saved]) == (ViewEdit("new", keyframes=PAN),)
    assert views_besides([more], []) == (more,)


def test_edits_are_read_back_from_the_text_that_they_made(scene: Scene) -> None:
    """Turned, keyed, renamed, removed and new views; what the scene has by now is no edit."""
    before = scene.manifest
    name = before.views[0].name
    edits = (
        ViewEdit(name, new_name="other", look=View(64, 48, 10.0, -5.0, 50.0), keyframes=PAN),
        ViewEdit("true", removed=True),
        ViewEdit("new", look=View(64, 48, 3.0), objects=("cube",), new=True),
    )
    made = edited_text(NewFiles(scene, scene.root), (), UNEDITED, text(scene), views=edits)
    after = parse_manifest(made, "scene.toml")
    found = {edit.name: edit for edit in view_edits(before, after, before)}
    assert set(found) == {name, "true", "new"}
    for edit in edits:
        same = replace(found[edit.name], look=edit.look)
        assert same == edit
        if edit.look is not None:
            seen = found[edit.name].look
            assert seen is not None
            assert seen.resized(64, 48) == edit.look
    assert view_edits(before, before, before) == ()
    assert [edit for edit in view_edits(before, after, after) if edit.new or edit.removed] == []
