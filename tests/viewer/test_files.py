"""The scene's files while they are edited, and edits that are saved and undone."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material
from iprt.scene.edits import ObjectEdit
from iprt.scene.scene import Scene
from iprt.scene.stance import Stance
from iprt.settings.model import Settings
from iprt.viewer.files import POLL_S
from iprt.viewer.history import GESTURE_S
from iprt.viewer.shared_state import SharedState
from iprt.viewer.state import Playback, World
from iprt.viewer.watch import MOST_FRAMES, Watch
from tests.clips import clip_color, write_clip
from tests.scene.files import CUBE, write_rgb
from tests.viewer.turns import Clock, Turns, turns

CLIP_FRAMES = 3

PLASTIC = Material("plastic", (0.2, 0.5, 0.3), alpha=0.3)
"""For which the clip's kernels need not be compiled again."""


def look_again(driver: Turns) -> None:
    """It is time to look at the scene's files, and what is found there is read."""
    driver.clock.now += POLL_S
    driver.core.turn()
    driver.settle()


def problems(driver: Turns) -> tuple[str, ...]:
    return driver.shared.status.problems


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
        look_again(driver)
        (problem,) = problems(driver)
        assert "cube.obj" in problem
        assert driver.shown(client) is first
        replaced(mesh, CUBE.replace("1 1 1", "1 2 1").encode())
        look_again(driver)
        assert problems(driver) == ()
        (state,) = driver.core.objects
        assert state.corners[1][1] == 2.0
        taller = driver.shown(client)
        assert taller is not first

        replaced(picture, b"no picture")
        look_again(driver)
        driver.until(lambda: bool(problems(driver)))
        (problem,) = problems(driver)
        assert "color.0000.exr" in problem
        assert np.array_equal(driver.shown(client).picture.color, taller.picture.color)
        write_rgb(picture, 2.0 * clip_color(0))
        look_again(driver)
        assert problems(driver) == ()
        brighter = driver.shown(client).picture.color
        np.testing.assert_allclose(np.median(brighter / taller.picture.color), 2.0, rtol=0.05)
        replaced(picture, good)
        look_again(driver)
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
            ObjectEdit("wedge", material=PLASTIC, path=path), (20.0, -40.0), Stance(height_m=0.3)
        )
        driver.settle()
        shared.edit("cube", lambda edit: replace(edit, removed=True))
        driver.settle()
        (shown,) = core.objects
        core.save()
        driver.settle()
        assert problems(driver) == ()
        assert shared.world.unsaved == ()
        (saved,) = core.objects
        loaded = core.scene
        look_again(driver)
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
        driver.shared.edit("cube", lambda edit: replace(edit, removed=True))
        path.write_text(text.replace("format = 1", "format = "))
        driver.core.save(told.append)
        driver.settle()
        assert told == list(problems(driver))
        assert "scene.toml: not valid TOML" in str(told[0])
        assert [edit.name for edit in driver.shared.world.edits] == ["cube"]
        path.write_text("# mine\n" + text)
        driver.core.save(told.append)
        driver.settle()
        assert told[1:] == [None]
        assert problems(driver) == ()
    assert path.read_text().startswith("# mine\n")
    assert Scene.open(scene.root).objects == ()


def test_edits_are_undone_and_made_again() -> None:
    clock = Clock()
    shared = SharedState(World(Settings(), Playback(0)), clock)

    def place(name: str, x: float) -> None:
        clock.now += 0.1
        shared.edit(name, lambda edit: replace(edit, to_world=(x,) * 16))

    def now() -> dict[str, tuple[float | None, bool, bool]]:
        return {
            edit.name: (edit.to_world and edit.to_world[0], edit.removed, edit.material is not None)
            for edit in shared.world.edits
        }

    states = [now()]
    for x in range(20):  # a drag
        place("a", float(x))
    states.append(now())
    shared.edit("a", lambda edit: replace(edit, material=Material()))
    states.append(now())
    place("b", 1.0)
    states.append(now())
    clock.now += 2 * GESTURE_S
    place("b", 2.0)
    states.append(now())
    shared.edit("a", lambda edit: replace(edit, removed=True))
    states.append(now())
    assert len({str(state) for state in states}) == len(states)
    for state in reversed(states[:-1]):
        shared.undo()
        assert now() == state
    last = shared.undo()
    assert shared.undo() == last, "nothing is left to undo"
    for state in states[1:]:
        shared.redo()
        assert now() == state
    assert shared.redo() == shared.redo()
    shared.undo()
    place("b", 3.0)
    assert shared.redo() == shared.redo(), "another edit was made since"
    shared.undo()
    assert now() == states[-2]
    shared.saved(shared.world.edits)
    assert shared.world.unsaved == ()
    shared.undo()
    assert shared.world.unsaved != ()
    shared.redo()
    assert shared.world.unsaved == ()
