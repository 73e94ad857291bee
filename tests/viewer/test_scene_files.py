"""The scene's files while they are edited, and edits that are saved and undone."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from iprt.device.compute import ComputeDevice
from iprt.files.text_merge import merged
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.scene.edit_writing import SAVED_VIEW, Look
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.object_edits import ObjectEdit, flat
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.viewer.file_watch import MOST_FRAMES, Watch
from iprt.viewer.history import GESTURE_S
from iprt.viewer.shared_state import SharedState
from iprt.viewer.state import Playback, World
from tests.clips import clip_color, write_clip
from tests.scene.files import CUBE, write_rgb
from tests.viewer.turns import FEWEST, VIEW, Clock, Turns, turns

CLIP_FRAMES = 3

PLASTIC = Material("plastic", (0.2, 0.5, 0.3), alpha=0.3)
"""For which the clip's kernels need not be compiled again."""


def replaced(path: Path, content: bytes) -> None:
    """As an editor saves a file: another one takes its place."""
    other = path.with_name(f".{path.name}.new")
    other.write_bytes(content)
    other.rename(path)


def test_every_file_of_the_scene_is_watched(tmp_path: Path) -> None:
    folder = write_clip(tmp_path / "clip", 3)
    manifest = folder / "scene.toml"
    (folder / "gltf").mkdir()
    (folder / "cube.mtl").write_text("newmtl m\nmap_Kd wood.png\n")
    Image.new("RGB", (4, 4)).save(folder / "wood.png")
    Image.new("RGB", (4, 4)).save(folder / "tiles.png")
    Image.new("L", (64, 32)).save(folder / "mask.png")
    (folder / "poses.json").write_text("[]")
    (folder / "cube.obj").write_text("mtllib cube.mtl\nusemtl m\n" + CUBE)
    text = manifest.read_text().replace("fps", 'poses = "poses.json"\nfps', 1)
    texture = '{ kind = "diffuse", albedo = [1, 1, 1], texture = "tiles.png" }'
    text = text.replace('{ kind = "plastic", albedo = [0.5, 0.3, 0.2], alpha = 0.2 }', texture)
    text += '\n[[real_materials]]\nname = "floor"\nkind = "plastic"\nmask = "mask.png"\n'
    manifest.write_text(text)
    watch = Watch(folder)
    stamp = dict(watch.look())
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert len(files) == 11
    for path in files:
        assert not watch.changed()
        content = path.read_bytes()
        path.unlink()
        assert not watch.changed(), "as editors have it for a moment"
        path.write_bytes(content)
        os.utime(path, ns=(1, 1))
        assert watch.changed(), path
    after = dict(watch.look())
    of_frames = {path.name for path in stamp}
    pictures = {f"color.{number:04d}.exr" for number in range(3)}
    assert of_frames == pictures | {"depth.exr", "mask.png", "poses.json"}
    assert all(after[path] != stamp[path] for path in stamp)
    manifest.write_text("nonsense")
    assert watch.changed()
    watch.look()
    os.utime(folder / "tiles.png", ns=(2, 2))
    assert watch.changed(), "what is still shown"


def test_of_long_videos_not_every_picture_is_watched(tmp_path: Path) -> None:
    folder = write_clip(tmp_path / "clip", 1)
    manifest = folder / "scene.toml"
    manifest.write_text(manifest.read_text().replace("frames = [0, 0]", "frames = [0, 99999]"))
    assert len(Watch(folder).look()) == MOST_FRAMES + 1


def test_meshes_and_pictures_are_followed_while_they_are_edited(
    scene: Scene, device: ComputeDevice
) -> None:
    """What is broken is told, and the last good state stays; mended, it is forgotten."""
    mesh, picture = scene.root / "cube.obj", scene.root / "color.0000.exr"
    good = picture.read_bytes()
    with turns(scene, device) as driver:
        client = driver.join()
        first = driver.answer(client)
        replaced(mesh, b"no mesh")
        driver.look_again()
        (problem,) = driver.problems
        assert "cube.obj" in problem
        assert driver.shown(client) is first
        replaced(mesh, CUBE.replace("1 1 1", "1 2 1").encode())
        driver.look_again()
        assert driver.problems == ()
        (state,) = driver.core.objects
        assert state.corners[1][1] == 2.0
        taller = driver.shown(client)
        assert taller is not first

        replaced(picture, b"no picture")
        driver.look_again()
        driver.until(lambda: bool(driver.problems))
        (problem,) = driver.problems
        assert "color.0000.exr" in problem
        assert np.array_equal(driver.shown(client).picture.color, taller.picture.color)
        write_rgb(picture, 2.0 * clip_color(0))
        driver.look_again()
        assert driver.problems == ()
        brighter = driver.shown(client).picture.color
        np.testing.assert_allclose(np.median(brighter / taller.picture.color), 2.0, rtol=0.05)
        replaced(picture, good)
        driver.look_again()
        seen = driver.shown(client).picture.color
        np.testing.assert_allclose(np.median(seen / taller.picture.color), 1.0, rtol=0.05)


def test_a_saved_scene_is_what_was_shown(
    scene: Scene, device: ComputeDevice, tmp_path: Path
) -> None:
    """And is not read once more because it was written."""
    path = tmp_path / "wedge.obj"
    path.write_text(CUBE.replace("1 1 1", "0.5 1.5 0.5"))
    with turns(scene, device) as driver:
        client = driver.join()
        driver.answer(client)
        core, shared = driver.core, driver.shared
        core.add(
            ObjectEdit("wedge", material=PLASTIC, path=path), (20.0, -40.0), MeshPose(height_m=0.3)
        )
        driver.settle()
        shared.edit(lambda world: world.edited("cube", removed=True))
        driver.settle()
        (shown,) = core.objects
        core.files.save()
        driver.settle()
        assert driver.problems == ()
        assert shared.world.unsaved == ()
        (saved,) = core.objects
        loaded = core.scene
        driver.look_again()
        assert core.scene is loaded
    (reopened,) = Scene.open(scene.root).instances
    for now in (saved, reopened):
        assert now.name == shown.name == "wedge"
        np.testing.assert_allclose(now.to_world, shown.to_world, rtol=1e-6, atol=1e-7)
        assert np.array_equal(now.mesh.positions, shown.mesh.positions)
        assert now.mesh.materials == shown.mesh.materials


def test_who_saves_is_told_what_came_of_it(scene: Scene, device: ComputeDevice) -> None:
    """A file that somebody broke meanwhile is left alone, and nothing is lost."""
    path, told = scene.root / "scene.toml", list[str | None]()
    text = path.read_text()
    with turns(scene, device) as driver:
        driver.answer(driver.join())
        driver.shared.edit(lambda world: world.edited("cube", removed=True))
        path.write_text(text.replace("format = 1", "format = "))
        driver.core.files.save(told.append)
        driver.settle()
        assert told == list(driver.problems)
        assert "scene.toml: not valid TOML" in str(told[0])
        assert [edit.name for edit in driver.shared.world.edits] == ["cube"]
        path.write_text("# mine\n" + text)
        driver.core.files.save(told.append)
        driver.settle()
        assert told[1:] == [None]
        assert driver.problems == ()
    assert path.read_text().startswith("# mine\n")
    assert Scene.open(scene.root).objects == ()


def test_edits_are_undone_and_made_again() -> None:
    """A gesture is one step; another edit ends what can be made again."""
    clock = Clock()
    shared = SharedState(World(Settings(), Playback(0)), clock)

    def place(name: str, x: float) -> None:
        clock.now += 0.1
        shared.edit(lambda world: world.edited(name, to_world=(x,) * 16))

    states = [shared.world.edits]
    for steps in (
        lambda: [place("a", float(x)) for x in range(20)],  # a drag
        lambda: shared.edit(lambda world: world.edited("a", material=Material())),
        lambda: place("b", 1.0),
        lambda: setattr(clock, "now", clock.now + 2 * GESTURE_S) or place("b", 2.0),
        lambda: shared.edit(lambda world: world.edited("a", removed=True)),
    ):
        steps()
        states.append(shared.world.edits)
    for state in reversed(states[:-1]):
        shared.undo()
        assert shared.world.edits == state
    assert shared.undo() == shared.undo(), "nothing is left to undo"
    for state in states[1:]:
        shared.redo()
        assert shared.world.edits == state
    shared.undo()
    place("b", 3.0)
    assert shared.redo() == shared.redo(), "another edit was made since"
    shared.undo()
    assert shared.world.edits == states[-2]
    shared.saved(shared.world)
    for change, unsaved in ((shared.undo, True), (shared.redo, False)):
        change()
        assert bool(shared.world.unsaved) == unsaved


def save(driver: Turns, look: Look | None = None) -> None:
    driver.core.files.save(look=look)
    driver.settle()
    assert driver.problems == ()
    assert driver.shared.world.unsaved == ()


@pytest.mark.thorough
def test_undo_goes_on_across_saves(scene: Scene, device: ComputeDevice, tmp_path: Path) -> None:
    """To the bytes that the file had: comments, materials and removed objects come back."""
    path = scene.root / "scene.toml"
    first = path.read_text() + "# the end\n"
    path.write_text(first)
    mesh = tmp_path / "other.obj"
    mesh.write_bytes((scene.root / "cube.obj").read_bytes())
    with turns(Scene.open(scene.root), device, FEWEST) as driver:
        driver.answer(driver.join())
        shared = driver.shared
        moved = flat(np.diag([0.2, 0.2, 0.2, 1.0]))
        shared.edit(lambda world: world.edited("cube", to_world=moved))
        save(driver)
        shared.edit(lambda world: world.edited("cube", material=PLASTIC))
        save(driver)
        assert 'kind = "plastic"' in path.read_text()
        shared.edit(lambda world: world.edited("cube", removed=True))
        driver.core.add(ObjectEdit("other", path=mesh), (20.0, -40.0), MeshPose(height_m=0.3))
        driver.settle()
        save(driver)
        assert [entry.name for entry in Scene.open(scene.root).objects] == ["other"]
        texts = [path.read_text()]
        while shared.history.can_undo:
            shared.undo()
            driver.settle()
            assert shared.world.unsaved
            save(driver)
            texts.append(path.read_text())
        assert texts[-1] == first
        assert [state.name for state in driver.core.objects] == ["cube"]
        while shared.history.can_redo:
            shared.redo()
        driver.settle()
        save(driver)
        assert path.read_text() == texts[0]


def test_what_others_write_is_kept(scene: Scene, device: ComputeDevice) -> None:
    """What was saved before can still be undone."""
    path = scene.root / "scene.toml"
    first = path.read_text()
    with turns(scene, device, FEWEST) as driver:
        driver.answer(driver.join())
        shared = driver.shared
        shared.edit(lambda world: world.edited("cube", material=PLASTIC))
        save(driver)
        replaced(path, path.read_bytes())
        driver.look_again()
        theirs = (("pitch_deg = -30.0", "pitch_deg = -31.0"), ('"ahead"', '"before"'))
        path.write_text(path.read_text().replace(*theirs[0]) + "# mine\n")
        driver.look_again()
        assert shared.history.can_undo
        assert driver.core.objects[0].materials == (PLASTIC,)
        shared.edit(lambda world: world.edited("cube", removed=True))
        path.write_text(path.read_text().replace(*theirs[1]) + "# too\n")  # not seen before saving
        save(driver)
        assert path.read_text().endswith("# mine\n# too\n")
        assert Scene.open(scene.root).objects == ()
        for _ in range(2):
            shared.undo()
        save(driver)
        assert path.read_text() == first.replace(*theirs[0]).replace(*theirs[1]) + "# mine\n# too\n"


def test_edits_of_the_same_lines_by_others_end_undo(scene: Scene, device: ComputeDevice) -> None:
    """The file may have it otherwise by now; edits that were not saved stay."""
    path = scene.root / "scene.toml"
    with turns(scene, device, FEWEST) as driver:
        driver.answer(driver.join())
        shared = driver.shared
        shared.edit(lambda world: world.edited("cube", material=PLASTIC))
        save(driver)
        path.write_text(path.read_text().replace("alpha = 0.3", "alpha = 0.4"))
        moved = flat(np.diag([0.2, 0.2, 0.2, 1.0]))
        shared.edit(lambda world: world.edited("cube", to_world=moved))
        driver.look_again()
        assert not shared.history.can_undo
        assert driver.core.objects[0].materials[0].alpha == 0.4


@pytest.mark.parametrize(
    ("ours", "theirs", "expected"),
    [
        ("a b c d", "a b c d", "a x c d"),
        ("a b c d", "a B c d", None),
        ("a b c d e", "a b c d e f", "a x c d f"),
        ("a b c d e", "z a b c d e", "z a x c d"),
        ("a b c d", "a b q c d", None),
        ("a b c d", "a b c q d", "a x c q d"),
        ("a b c d", "a c d", None),
        ("a b c d", "a b d", "a x d"),
        ("a b c d", "", None),
    ],
)
def test_changes_by_others_are_merged(ours: str, theirs: str, expected: str | None) -> None:
    """Into `a x c d`, of which `x` was changed to `b`."""
    texts = ("a x c d", ours, theirs)
    found = merged(*("".join(f"{word}\n" for word in text.split()) for text in texts))
    assert (None if found is None else found.split()) == (expected and expected.split())


@pytest.fixture
def judged(scene: Scene) -> Scene:
    """Its only view has a truth."""
    path = scene.root / "scene.toml"
    path.write_text(path.read_text() + 'objects = ["cube"]\ntruth = "truth.exr"\n')
    write_rgb(scene.root / "truth.exr", np.zeros((VIEW.height, VIEW.width, 3), np.float32))
    return Scene.open(scene.root)


@pytest.mark.thorough
def test_what_was_added_is_seen_when_the_scene_is_opened_again(
    judged: Scene, device: ComputeDevice
) -> None:
    """In a view of its own, where the user looked; `iprt view` opens that one."""
    look = Look(View(640, 480, 12.0, -34.0, 50.0))
    mesh = judged.root / "cube.obj"
    with turns(judged, device, FEWEST) as driver:
        driver.answer(driver.join())
        driver.core.add(ObjectEdit("other", path=mesh), (20.0, -40.0), MeshPose(height_m=0.3))
        driver.settle()
        save(driver, look)
        driver.shared.edit(lambda world: world.edited("other", material=PLASTIC))
        save(driver, replace(look, view=replace(look.view, yaw_deg=15.0)))
    reopened = Scene.open(judged.root)
    assert list(reopened.views) == [*judged.views, SAVED_VIEW]
    saved = reopened.views[SAVED_VIEW]
    assert saved.view == replace(look.view, yaw_deg=15.0)
    assert saved.objects == ("cube", "other")
    with turns(reopened, device, FEWEST) as driver:
        shown = driver.answer(driver.join(view=VIEW, objects=saved.objects))
        assert shown.geometry is not None
        assert shown.geometry.names == ("cube", "other")
        # Later saves keep it up to date, with what is shown then.
        driver.shared.edit(lambda world: world.edited("cube", material=PLASTIC))
        save(driver, Look(look.view, ("other",)))
    assert Scene.open(judged.root).views[SAVED_VIEW].objects == ("other",)


def test_no_view_is_made_where_all_is_seen(scene: Scene, device: ComputeDevice) -> None:
    with turns(scene, device, FEWEST) as driver:
        driver.answer(driver.join())
        driver.core.add(
            ObjectEdit("other", path=scene.root / "cube.obj"), (20.0, -40.0), MeshPose(height_m=0.3)
        )
        driver.settle()
        save(driver, Look(View(64, 48)))
    assert list(Scene.open(scene.root).views) == list(scene.views)
