"""Many objects are arranged as one, saved, and undone in whole steps."""

from __future__ import annotations

from queue import SimpleQueue

import numpy as np
import pytest

from iprt.scene.placement import RealSurfaces
from iprt.scene.scene import Scene
from iprt.viewer.actions import actions
from iprt.viewer.arranging_fields import array_fields, group_field, name_field
from iprt.viewer.engine import Engine
from iprt.viewer.fields import place_fields
from iprt.viewer.object_states import ObjectState
from tests.viewer.viewports import Ui, at_rest, until
from tests.waiting import DEADLINE_S

UPRIGHT = np.cos(np.deg2rad(20.0))
"""Normals are averaged over a quarter of the small panorama, and so over a part of the walls."""


def states(ui: Ui, *names: str) -> list[ObjectState]:
    """Once the picture has just these objects."""
    until(ui.viewport, lambda _: {state.name for state in ui.engine.objects} == set(names))
    found = [ui.engine.object_state(name) for name in names]
    assert None not in found
    return [state for state in found if state is not None]


def saved(engine: Engine) -> Scene:
    done: SimpleQueue[str | None] = SimpleQueue()
    engine.save(done.put)
    assert done.get(timeout=DEADLINE_S) is None
    return Scene.open(engine.scene.root)


def by_name(scene: Scene) -> dict[str, np.ndarray]:
    return {instance.name: instance.to_world for instance in scene.instances}


def test_copies_stand_beside_and_are_saved_as_what_they_copy(ui: Ui) -> None:
    """With material and all; the copy of a copy, and of an edited one, too."""
    do = actions(ui)
    ui.selection.paint(albedo=(0.1, 0.2, 0.3))
    do["duplicate"].act()
    assert ui.selected == "cube-2"
    cube, copy = states(ui, "cube", "cube-2")
    do["duplicate"].act()
    assert ui.selected == "cube-3"
    *_, last = states(ui, "cube", "cube-2", "cube-3")
    right = ui.viewport.view.world_from_view[:, 0]
    extent = cube.box @ right
    for left, other in ((cube, copy), (copy, last)):
        np.testing.assert_allclose(
            other.pivot - left.pivot, 1.1 * np.ptp(extent) * right, atol=1e-9
        )
        assert (other.box @ right).min() > (left.box @ right).max()
        assert other.materials == cube.materials
    scene = saved(ui.engine)
    tables = {table.name: table for table in scene.manifest.objects}
    assert list(tables) == ["cube", "cube-2", "cube-3"]
    for table in tables.values():
        assert table.mesh == "cube.obj"
        assert table.material is not None
        assert table.material.albedo == [0.1, 0.2, 0.3]  # type: ignore[union-attr]
    np.testing.assert_allclose(by_name(scene)["cube-3"], last.to_world, atol=1e-6)
    assert not ui.engine.unsaved
    do["undo"].act()
    do["undo"].act()
    assert list(by_name(saved(ui.engine))) == ["cube"]


def test_copies_keep_keyframes(ui: Ui) -> None:
    """The picture shows what is rendered after saving."""
    scene = ui.engine.scene
    manifest = scene.root / "scene.toml"
    keys = "[[objects.keyframes]]\ntime = 0\ntranslation = [0.2, 0, 0]\n"
    manifest.write_text(manifest.read_text().replace("[[views]]", f"{keys}\n[[views]]"))
    until(ui.viewport, lambda _: any(state.keyframed for state in ui.engine.objects))
    ui.duplicate()
    cube, copy = states(ui, "cube", "cube-2")
    assert copy.keyframed
    found = by_name(saved(ui.engine))
    for state in (cube, copy):
        np.testing.assert_allclose(found[state.name], state.to_world, atol=1e-6)


def test_selected_objects_move_turn_and_grow_as_one(ui: Ui) -> None:
    """About the pivot of the primary one, by fields as by gizmos; one step of undo."""
    ui.duplicate()
    states(ui, "cube", "cube-2")
    ui.selection.toggle("cube")
    assert ui.selection.names == ("cube-2", "cube")
    cube, copy = states(ui, "cube", "cube-2")
    apart = copy.pivot - cube.pivot
    fields = {field.key: field for field in place_fields(ui)}
    fields["position"].write(tuple(cube.pivot + np.array([0.0, 0.25, 0.0])))
    one, other = states(ui, "cube", "cube-2")
    np.testing.assert_allclose(one.pivot - cube.pivot, (0.0, 0.25, 0.0), atol=1e-9)
    np.testing.assert_allclose(other.pivot - one.pivot, apart, atol=1e-9)
    x, y, z = fields["rotation"].read()
    fields["rotation"].write((x, y + 90.0, z))
    one, other = states(ui, "cube", "cube-2")
    np.testing.assert_allclose(other.pivot - one.pivot, (apart[2], apart[1], -apart[0]), atol=1e-6)
    fields["size"].write(2.0 * fields["size"].read())
    grown, far = states(ui, "cube", "cube-2")
    np.testing.assert_allclose(far.pivot - grown.pivot, 2.0 * (other.pivot - one.pivot), atol=1e-4)
    np.testing.assert_allclose(far.size, 2.0 * other.size, rtol=1e-4)


def test_groups_are_selected_saved_and_copied_whole(ui: Ui) -> None:
    do = actions(ui)
    assert not do["group"].enabled()
    ui.duplicate()
    states(ui, "cube", "cube-2")
    ui.selection.select("cube", "cube-2")
    do["group"].act()
    ui.selected = None
    states(ui, "cube", "cube-2")
    until(ui.viewport, lambda _: ui.engine.objects[0].group == "group")
    ui.pick("cube", more=False)
    assert ui.selection.names == ("cube-2", "cube")
    ui.pick("cube", more=True)
    assert ui.selection.names == ()
    group_field(ui).write(False)
    ui.pick("cube", more=False)
    assert ui.selection.names == ("cube",)
    group_field(ui).write(True)
    assert set(ui.selection.names) == {"cube", "cube-2"}
    ui.duplicate()
    *_, third, fourth = states(ui, "cube", "cube-2", "cube-3", "cube-4")
    assert third.group == fourth.group == "group-2"
    assert [table.group for table in saved(ui.engine).manifest.objects] == [
        "group",
        "group",
        "group-2",
        "group-2",
    ]
    do["ungroup"].act()
    assert [t.group for t in saved(ui.engine).manifest.objects] == ["group"] * 2 + [None] * 2


def test_locked_objects_are_passed_over(ui: Ui) -> None:
    do = actions(ui)
    x, y = next(
        (x, y)
        for y in np.linspace(0.05, 0.95, 24)
        for x in np.linspace(0.05, 0.95, 24)
        if ui.object_at(x, y) == "cube"
    )
    before = ui.state
    assert before is not None
    do["lock"].act()
    assert ui.object_at(x, y) is None
    moved = before.to_world.copy()
    moved[0, 3] += 1.0
    ui.selection.place(before, moved)
    ui.selection.paint(albedo=(1.0, 0.0, 0.0))
    ui.selection.remove()
    assert ui.said == [("cube is locked", True)] * 3
    (state,) = states(ui, "cube")
    assert np.array_equal(state.to_world, before.to_world)
    assert state.materials == before.materials
    assert saved(ui.engine).manifest.objects[0].locked
    do["select all"].act()
    assert ui.selection.names == ()
    ui.selected = "cube"
    do["lock"].act()
    assert "locked" not in (ui.engine.scene.root / "scene.toml").read_text() or ui.engine.unsaved
    assert not saved(ui.engine).manifest.objects[0].locked


def test_renamed_objects_keep_their_place_in_the_file(ui: Ui) -> None:
    """Comments and views too; the truth of a view stays valid."""
    manifest = ui.engine.scene.root / "scene.toml"
    text = manifest.read_text().replace('name = "cube"', 'name = "cube"  # the only one')
    manifest.write_text(text.replace("size = ", 'objects = ["cube"]\nsize = '))
    until(ui.viewport, lambda _: "only one" in ui.engine._core.files.loaded.text)
    at_rest(ui.viewport)
    name = name_field(ui)
    name.write("vase")
    assert name.read() == "vase"
    states(ui, "vase")
    assert ui.engine.unsaved == ("cube", "vase")
    saved(ui.engine)
    after = manifest.read_text()
    assert after == text.replace("size = ", 'objects = ["cube"]\nsize = ').replace(
        '"cube"', '"vase"'
    )
    ui.duplicate()
    states(ui, "vase", "vase-2")
    ui.selected = "vase"
    name.write("vase-2")
    assert ui.selected == "vase-2-2", "a name that is taken gets a number"
    name.write("  ")
    assert ui.selected == "vase-2-2"
    for _ in range(3):
        ui.go_back(ui.engine.undo)
    saved(ui.engine)
    assert manifest.read_text() == after.replace('"vase"', '"cube"')


def test_an_array_is_one_step_of_undo(ui: Ui) -> None:
    do, fields = actions(ui), {field.key: field for field in array_fields(ui)}
    fields["array_count"].write(4)
    fields["array_step"].write((0.1, 0.0, -0.2))
    do["array"].act()
    found = states(ui, "cube", "cube-2", "cube-3", "cube-4")
    for number, state in enumerate(found):
        expected = found[0].pivot + number * np.array([0.1, 0.0, -0.2])
        np.testing.assert_allclose(state.pivot, expected, atol=1e-9)
    do["undo"].act()
    states(ui, "cube")
    assert not do["undo"].enabled()


@pytest.mark.parametrize("lift", [0.4, -0.1])
def test_objects_are_dropped_to_the_floor(ui: Ui, lift: float) -> None:
    """Their lowest point touches it, however they are turned; aligned ones stand upright there."""
    state, do = ui.state, actions(ui)
    assert state is not None
    frame = ui.engine._core.video.frame
    assert frame is not None
    floor = RealSurfaces(frame).floor()
    tilted = state.to_world.copy()
    angle = np.deg2rad(30.0)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    tilted[:3, :3] = turn @ tilted[:3, :3]
    tilted[1, 3] = floor + 0.5 + lift
    ui.selection.place(state, tilted)
    do["settle"].act()
    until(ui.viewport, lambda _: ui.state is not None and ui.state.to_world[1, 3] != tilted[1, 3])
    settled = ui.state
    assert settled is not None
    assert abs(settled.box[:, 1].min() - floor) < 1e-3
    np.testing.assert_allclose(settled.to_world[[0, 2], 3], tilted[[0, 2], 3])
    ui.align = True
    do["settle"].act()
    until(ui.viewport, lambda _: ui.state is not None and ui.state.to_world[1, 1] > 0.3 * UPRIGHT)
    assert ui.state is not None
    assert abs(ui.state.pivot[1] - floor) < 1e-3
