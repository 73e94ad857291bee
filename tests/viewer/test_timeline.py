"""Keys and views are edited in a window, seen, undone, saved and read again."""

from __future__ import annotations

from dataclasses import replace
from queue import SimpleQueue

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.film import footage_of
from iprt.geometry.camera import View
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.viewer.actions import actions
from iprt.viewer.fields import Field, place_fields, view_field
from iprt.viewer.gizmo import path_segments
from iprt.viewer.timeline_fields import (
    key_fields,
    record_field,
    timeline_actions,
    view_name_field,
)
from tests.viewer.turns import SETTINGS
from tests.viewer.viewports import Ui, at_rest, until
from tests.waiting import DEADLINE_S

CLIP_FRAMES = 6
FPS = 24.0


def saved(ui: Ui) -> Scene:
    done: SimpleQueue[str | None] = SimpleQueue()
    ui.engine.save(done.put)
    assert done.get(timeout=DEADLINE_S) is None
    assert not ui.engine.unsaved
    return Scene.open(ui.engine.scene.root)


def seek(ui: Ui, frame: int) -> None:
    ui.engine.seek(frame)
    until(ui.viewport, lambda s: s.shown.frame == frame and s.shown.refined)


def place(ui: Ui, frame: int) -> np.ndarray:
    """Where the cube's pivot is then."""
    seek(ui, frame)
    assert ui.state is not None
    return ui.state.pivot.copy()


def put(ui: Ui, frame: int, by: tuple[float, float, float]) -> None:
    """Move the cube by its field."""
    at = place(ui, frame)
    fields = {field.key: field for field in place_fields(ui)}
    fields["position"].write(tuple(at + by))


def fields_of(ui: Ui) -> dict[str, Field]:
    return {field.key: field for field in key_fields(ui)}


def key_frames(ui: Ui) -> list[int]:
    row = ui.timeline.primary
    assert row is not None
    return [round(ui.timeline.frame_of(key.time)) for key in row.keys]


def animated(ui: Ui) -> None:
    """The cube is up by 0.4 m in frame 4, after keys at 0 and 4."""
    timeline_actions(ui)["key"].act()
    record_field(ui).write(True)
    put(ui, 4, (0.0, 0.4, 0.0))
    record_field(ui).write(False)


def test_recorded_keys_move_an_object_as_it_is_read_again(ui: Ui) -> None:
    """And without recording the whole motion moves, as one step."""
    start = place(ui, 0)
    animated(ui)
    assert key_frames(ui) == [0, 4]
    for frame, height in ((0, 0.0), (2, 0.2), (4, 0.4), (5, 0.4)):
        np.testing.assert_allclose(place(ui, frame) - start, (0.0, height, 0.0), atol=1e-6)
    assert ui.engine.unsaved == ("cube",)
    put(ui, 2, (0.1, 0.0, 0.0))
    np.testing.assert_allclose(place(ui, 4) - start, (0.1, 0.4, 0.0), atol=1e-6)
    scene = saved(ui)
    assert [key.time for key in scene.objects[0].motion.keyframes] == [0.0, 4 / FPS]
    for frame in range(CLIP_FRAMES):
        seek(ui, frame)
        assert ui.state is not None
        (instance,) = scene.instances_at(scene.time_of(frame))
        np.testing.assert_allclose(instance.to_world, ui.state.to_world, atol=1e-6)
    while ui.engine.can_undo:
        actions(ui)["undo"].act()
    until(ui.viewport, lambda _: key_frames(ui) == [])
    assert not saved(ui).objects[0].motion.moves
    actions(ui)["redo"].act()
    assert key_frames(ui)[0] == 0


def test_lights_have_keys_too(ui: Ui) -> None:
    until(ui.viewport, lambda s: s.shown.geometry is not None)
    ui.add_light()
    until(ui.viewport, lambda _: ui.state is not None and ui.state.light is not None)
    animated(ui)
    table = saved(ui).manifest.objects[1]
    assert table.light is not None
    assert [key.time for key in table.keyframes] == [0.0, 4 / FPS]


def test_chosen_keys_are_moved_copied_and_deleted(ui: Ui) -> None:
    start = place(ui, 0)
    animated(ui)
    fields, do, timeline = fields_of(ui), timeline_actions(ui), ui.timeline
    assert not do["delete keys"].enabled()
    assert [label.name for label in fields["key"].options().values()] == [
        "none",
        "0, linear",
        "4, linear",
    ]
    fields["key"].write(list(fields["key"].options())[2])
    assert ui.frame == 4
    fields["key_frame"].write(2)
    assert key_frames(ui) == [0, 2]
    assert fields["key_frame"].read() == 2
    np.testing.assert_allclose(place(ui, 1) - start, (0.0, 0.2, 0.0), atol=1e-6)
    timeline.shift(3, copy=True)
    assert key_frames(ui) == [0, 2, 5]
    assert fields["key_frame"].read() == 5
    timeline.shift(-3)
    assert ui.said[-1] == ("there is a key at 0.0833333 s already; delete it first", True)
    timeline.shift(-9)
    assert ui.said[-1] == ("keys cannot be before the first frame", True)
    assert key_frames(ui) == [0, 2, 5]
    fields["key"].write(list(fields["key"].options())[1])
    fields["interpolation"].write("smooth")
    assert fields["interpolation"].read() == "smooth"
    heights = [place(ui, frame)[1] - start[1] for frame in (0, 1, 2)]
    np.testing.assert_allclose(heights, (0.0, 0.2, 0.4), atol=1e-6)
    do["delete keys"].act()
    assert key_frames(ui) == [2, 5]
    actions(ui)["lock"].act()
    do["key"].act()
    assert ui.said[-1] == ("cube is locked", True)


def test_the_path_is_where_the_pivot_goes(ui: Ui) -> None:
    assert ui.state is not None
    assert ui.timeline.path(ui.state)[0].shape == (0, 3)
    animated(ui)
    assert ui.state is not None
    points, at_keys = ui.timeline.path(ui.state)
    np.testing.assert_allclose(at_keys, [place(ui, 0), place(ui, 4)], atol=1e-6)
    for frame in range(5):
        gaps = np.linalg.norm(points - place(ui, frame), axis=1)
        assert gaps.min() < 0.4 / 96


def test_paths_end_at_the_camera() -> None:
    """A line from behind is seen from just before the camera on."""
    line = np.array([[0.5, 0.0, 1.0], [0.5, 0.0, -1.0], [0.5, 0.0, -3.0]])
    view = View(64, 32)
    first, second = path_segments(line, view, np.zeros(3))
    np.testing.assert_allclose(first[1], view.project(line[1]))
    np.testing.assert_allclose(first[0], view.project(np.array([0.5, 0.0, -0.01])))
    np.testing.assert_allclose(second, view.project(line[1:]))
    assert not len(path_segments(line[:1], view, np.zeros(3)))
    assert not len(path_segments(-line[1:], view, np.zeros(3)))


def turn_view(ui: Ui, frame: int, yaw: float) -> None:
    """Set a key of the view there."""
    seek(ui, frame)
    ui.viewport.look(replace(ui.viewport.view, yaw_deg=yaw, pitch_deg=-25.0, fov_y_deg=50.0))
    timeline_actions(ui)["key"].act()


def test_keys_of_a_view_turn_the_picture_as_it_is_rendered(ui: Ui, device: ComputeDevice) -> None:
    """Paused and playing, of the frame that is shown, until the user turns away."""
    ui.selected = None
    turn_view(ui, 0, 10.0)
    turn_view(ui, 4, 30.0)
    assert ui.viewport.name == "ahead"
    scene = saved(ui)
    entry = scene.views["ahead"]
    for frame in (4, 1):
        seek(ui, frame)
        assert ui.viewport.view == entry.at(frame / FPS)
    number = ui.engine.set_settings(SETTINGS.model_copy(update={"seed": 7}))
    shown = until(ui.viewport, lambda s: s.shown.number >= number and s.shown.refined).shown
    still = SETTINGS.model_copy(update={"fading": 0.0, "seed": 7})
    footage = footage_of(scene, scene.frame(), SETTINGS)
    with Renderer(
        device,
        scene.frame(1),
        scene.instances_at(1 / FPS),
        entry.at(1 / FPS),
        still,
        footage=footage,
    ) as renderer:
        expected = renderer.render(1).color
    assert shown.frame == 1
    np.testing.assert_array_equal(shown.picture.color, expected)
    ui.engine.set_playback_mode("every frame")
    ui.engine.play()
    seen = set()

    def follows() -> bool:
        displayed = ui.viewport.poll()
        assert displayed is not None
        frame = displayed.shown.frame
        assert displayed.shown.request.view == entry.at(frame / FPS)
        seen.add(frame)
        return not ui.playing and frame == 5

    until(ui.viewport, lambda _: follows())
    assert seen >= {1, 2, 3, 4, 5}
    ui.viewport.turn(5.0, 0.0)
    seek(ui, 0)
    assert ui.viewport.name is None
    assert ui.viewport.view.yaw_deg != entry.at(0.0).yaw_deg
    assert view_field(ui).read() == "(turned)"


def test_views_are_added_named_turned_and_removed(ui: Ui) -> None:
    do, name = timeline_actions(ui), view_name_field(ui)
    ui.viewport.turn(7.0, 3.0)
    look = ui.viewport.view
    do["add view"].act()
    assert (ui.viewport.name, name.read()) == ("view", "view")
    name.write("corner")
    assert (ui.viewport.name, name.read()) == ("corner", "corner")
    name.write("ahead")
    assert name.read() == "ahead-2"
    assert ui.engine.unsaved == ("view ahead-2",)
    assert list(view_field(ui).options()) == ["ahead", "ahead-2"]
    views = saved(ui).views
    found = views["ahead-2"].view
    assert (found.yaw_deg, found.pitch_deg) == pytest.approx(
        (look.yaw_deg, look.pitch_deg), abs=1e-3
    )
    assert views["ahead-2"].objects == ("cube",)
    ui.go_to("ahead")
    ui.viewport.turn(7.0, 3.0)
    assert do["look"].enabled()
    do["look"].act()
    assert ui.viewport.name == "ahead"
    assert saved(ui).views["ahead"].view.yaw_deg == pytest.approx(look.yaw_deg, abs=1e-3)
    do["remove view"].act()
    assert ui.viewport.view == at_rest(ui.viewport).shown.request.view
    assert list(saved(ui).views) == ["ahead-2"]
    for _ in range(3):
        actions(ui)["undo"].act()
    assert list(saved(ui).views) == ["ahead", "view"]


def test_files_that_others_change_keep_edits_of_views(ui: Ui) -> None:
    """Unsaved ones stay; saved ones are in the file."""
    ui.selected = None
    turn_view(ui, 0, 10.0)
    saved(ui)
    view_name_field(ui).write("pan")
    manifest = ui.engine.scene.root / "scene.toml"
    manifest.write_text(manifest.read_text().replace("fps = 24.0", "fps = 12.0"))
    until(ui.viewport, lambda _: ui.engine.scene.source.fps == 12.0)
    assert list(ui.engine.views) == ["pan"]
    assert ui.engine.unsaved == ("view pan",)
    (entry,) = saved(ui).views.values()
    assert (entry.name, entry.view.yaw_deg) == ("pan", 10.0)
