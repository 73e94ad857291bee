"""What is saved can be undone, and is there when the scene is opened again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.scene.edits import SAVED_VIEW, Look, ObjectEdit, flat
from iprt.scene.scene import Scene
from iprt.scene.stance import Stance
from iprt.viewer.core import POLL_S
from tests.scene.files import write_rgb
from tests.viewer.turns import FEWEST, VIEW, Turns, turns

PLASTIC = Material("plastic", (0.4, 0.2, 0.1), alpha=0.2)


def save(driver: Turns, look: Look | None = None) -> None:
    driver.core.save(look=look)
    driver.settle()
    assert driver.shared.status.problems == ()
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
        shared.edit("cube", lambda edit: replace(edit, to_world=moved))
        save(driver)
        shared.edit("cube", lambda edit: replace(edit, material=PLASTIC))
        save(driver)
        assert 'kind = "plastic"' in path.read_text()
        shared.edit("cube", lambda edit: replace(edit, removed=True))
        driver.core.add(ObjectEdit("other", path=mesh), (20.0, -40.0), Stance(height_m=0.3))
        driver.settle()
        save(driver)
        assert [entry.name for entry in Scene.open(scene.root).objects] == ["other"]
        texts = [path.read_text()]
        while shared.can_undo:
            shared.undo()
            driver.settle()
            assert shared.world.unsaved
            save(driver)
            texts.append(path.read_text())
        assert texts[-1] == first
        assert [state.name for state in driver.core.objects] == ["cube"]
        while shared.can_redo:
            shared.redo()
        driver.settle()
        save(driver)
        assert path.read_text() == texts[0]


def test_what_others_write_is_kept(scene: Scene, device: ComputeDevice) -> None:
    """What was saved before cannot be undone then: the file may have it otherwise by now."""
    path = scene.root / "scene.toml"
    with turns(scene, device, FEWEST) as driver:
        driver.answer(driver.join())
        shared = driver.shared
        shared.edit("cube", lambda edit: replace(edit, material=PLASTIC))
        save(driver)
        path.write_text(path.read_text().replace("yaw_deg = 0.0", "yaw_deg = 7.0") + "# mine\n")
        driver.clock.now += POLL_S
        driver.core.turn()
        driver.settle()
        assert not shared.can_undo
        assert driver.core.objects[0].materials == (PLASTIC,)
        shared.edit("cube", lambda edit: replace(edit, removed=True))
        path.write_text(path.read_text() + "# too\n")  # not seen before it is saved
        save(driver)
        assert path.read_text().endswith("# mine\n# too\n")
    assert Scene.open(scene.root).objects == ()


@pytest.fixture
def judged(scene: Scene) -> Scene:
    """Its only view has a truth."""
    path = scene.root / "scene.toml"
    path.write_text(path.read_text() + 'objects = ["cube"]\ntruth = "truth.exr"\n')
    write_rgb(scene.root / "truth.exr", np.zeros((VIEW.height, VIEW.width, 3), np.float32))
    return Scene.open(scene.root)


def test_saved_edits_outdate_the_truth(judged: Scene, device: ComputeDevice) -> None:
    """Until they are undone and the scene is saved again."""
    path = judged.root / "scene.toml"
    first = path.read_text()
    with turns(judged, device, FEWEST) as driver:
        driver.answer(driver.join())
        driver.shared.edit("cube", lambda edit: replace(edit, material=PLASTIC))
        save(driver)
        assert Scene.open(judged.root).views["ahead"].truth_outdated
        driver.shared.undo()
        driver.settle()
        save(driver)
    assert path.read_text() == first


@pytest.mark.thorough
def test_what_was_added_is_seen_when_the_scene_is_opened_again(
    judged: Scene, device: ComputeDevice
) -> None:
    """In a view of its own, where the user looked; `iprt view` opens that one."""
    look = Look(View(640, 480, 12.0, -34.0, 50.0))
    mesh = judged.root / "cube.obj"
    with turns(judged, device, FEWEST) as driver:
        driver.answer(driver.join())
        driver.core.add(ObjectEdit("other", path=mesh), (20.0, -40.0), Stance(height_m=0.3))
        driver.settle()
        save(driver, look)
        driver.shared.edit("other", lambda edit: replace(edit, material=PLASTIC))
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
        driver.shared.edit("cube", lambda edit: replace(edit, material=PLASTIC))
        save(driver, Look(look.view, ("other",)))
    assert Scene.open(judged.root).views[SAVED_VIEW].objects == ("other",)


def test_no_view_is_made_where_all_is_seen(scene: Scene, device: ComputeDevice) -> None:
    with turns(scene, device, FEWEST) as driver:
        driver.answer(driver.join())
        driver.core.add(
            ObjectEdit("other", path=scene.root / "cube.obj"), (20.0, -40.0), Stance(height_m=0.3)
        )
        driver.settle()
        save(driver, Look(View(64, 48)))
    assert list(Scene.open(scene.root).views) == list(scene.views)
