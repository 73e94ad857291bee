"""Comparisons, truths among them: what they show, when they are scored, and what is told."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.measure import metrics
from iprt.output.display import display
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.scene import Scene
from iprt.viewer.displayed_frame import OUTDATED, PictureDeveloper
from iprt.viewer.engine import Engine
from iprt.viewer.lens import Lens
from iprt.viewer.viewport import Viewport
from tests.clips import write_clip
from tests.scene.files import write_rgb
from tests.viewer.turns import SETTINGS, VIEW
from tests.viewer.viewports import LOOK, at_rest, until
from tests.waiting import DEADLINE_S


@pytest.fixture
def judged(tmp_path: Path) -> Scene:
    """Its view has a truth."""
    folder = write_clip(tmp_path / "clip", 1)
    manifest = folder / "scene.toml"
    manifest.write_text(manifest.read_text() + 'objects = ["cube"]\ntruth = "truth.exr"\n')
    write_rgb(folder / "truth.exr", np.ones((VIEW.height, VIEW.width, 3), np.float32))
    return Scene.open(folder)


def test_truth_is_scored_as_iprt_compare_does(judged: Scene, device: ComputeDevice) -> None:
    """SSIM of the shared scene format's own score function, and only in the view that it shows."""
    from iprt.measure.view_truth import read_target

    name, own = "ahead", VIEW.resized(8 * VIEW.width, 8 * VIEW.height)
    file = judged.root / "scene.toml"
    file.write_text(file.read_text().replace("size = [32, 16]", "size = [256, 128]"))
    ramp = np.linspace(0.2, 0.8, own.height, dtype=np.float32)[:, None, None]
    write_rgb(judged.root / "truth.exr", np.tile(ramp, (1, own.width, 3)))
    scene = Scene.open(judged.root)
    with Engine(scene, lambda: device, SETTINGS) as engine:
        viewport = Viewport(engine, own.resized(own.width // 8 + 3, own.height // 8 + 5), frames=1)
        viewport.go_to(name)
        viewport.lens = Lens(against="truth")
        displayed = until(viewport, lambda s: "SSIM" in s.caption)
        size = (displayed.pixels.shape[1], displayed.pixels.shape[0])
        assert scene.views[name].view.width == own.width == 8 * size[0]
        target = read_target(scene, name, "panorama", size, displayed.shown.frame)
        score = target.score(displayed.shown.picture.color).ssim
        assert f"SSIM {score:.3f}" in displayed.caption
        right = np.rint(255.0 * target.shown)[:, size[0] // 2 :]
        np.testing.assert_array_equal(displayed.pixels[:, size[0] // 2 :], right)
        viewport.turn(3.0, 0.0)
        turned = until(viewport, lambda s: "truth" in s.caption and "|" not in s.caption)
        assert turned.shown is not None
        viewport.close()


@pytest.mark.thorough
def test_what_was_added_is_shown_in_views_that_list_objects(
    device: ComputeDevice, judged: Scene
) -> None:
    """And stays when it is saved, also in a view with a truth, which does not list it then."""
    with Engine(judged, lambda: device, SETTINGS) as engine:
        viewport = Viewport(engine, LOOK, objects=("cube",), frames=1)
        at_rest(viewport)
        mesh, pose = judged.root / "cube.obj", MeshPose(height_m=0.1)
        name = engine.editor.add(mesh, *viewport.aim(0.5, 0.9), pose=pose)
        until(viewport, lambda s: s.shown.geometry is not None and name in s.shown.geometry.names)
        engine.save()
        until(viewport, lambda s: not engine.unsaved)
        assert engine.scene.views["ahead"].objects == ("cube",)
        shown = at_rest(viewport).shown
        assert shown.geometry is not None
        assert shown.geometry.names == ("cube", name)
        viewport.close()


def test_a_truth_that_cannot_be_read_is_told(device: ComputeDevice, judged: Scene) -> None:
    (judged.root / "truth.exr").write_bytes(b"no picture")
    with Engine(judged, lambda: device, SETTINGS) as engine:
        viewport = Viewport(engine, VIEW, frames=1)
        viewport.lens = Lens(against="truth")
        until(viewport, lambda s: "truth.exr" in s.caption)
        viewport.close()


def test_a_truth_of_other_objects_is_stale(device: ComputeDevice, judged: Scene) -> None:
    """What was edited, added or hidden since; not once that is taken back."""
    with Engine(judged, lambda: device, SETTINGS) as engine:
        viewport = Viewport(engine, VIEW, objects=("cube",), frames=1)
        at_rest(viewport)
        assert viewport.truth_problem is None
        viewport.lens = Lens(against="truth")
        assert until(viewport, lambda s: "SSIM" in s.caption).warning == ""
        matrix = engine.objects[0].to_world.copy()
        matrix[0, 3] += 0.1
        engine.editor.place({"cube": matrix})
        stale = until(viewport, lambda s: bool(s.warning))
        assert "truth" in stale.warning
        assert "SSIM" not in stale.caption
        engine.undo()
        until(viewport, lambda s: not s.warning and "SSIM" in s.caption)
        viewport.objects = ()
        until(viewport, lambda s: s.shown.request.objects == () and bool(s.warning))
        viewport.turn(1.0, 0.0)
        assert viewport.truth_problem == "only the scene's own views have a truth: go to one"
        viewport.close()


@pytest.mark.thorough
@pytest.mark.parametrize("removed", [False, True])
def test_a_truth_is_stale_after_edits_are_saved(
    device: ComputeDevice, judged: Scene, removed: bool
) -> None:
    """Also for those who open the scene then, until they say that the truth was made again."""
    with Engine(judged, lambda: device, SETTINGS) as engine:
        viewport = Viewport(engine, VIEW, objects=("cube",), frames=1)
        at_rest(viewport)
        viewport.lens = Lens(against="truth")
        until(viewport, lambda s: "SSIM" in s.caption)
        engine.editor.remove(["cube"]) if removed else engine.editor.place(
            {"cube": np.diag([0.2, 0.2, 0.2, 1.0])}
        )
        engine.save()
        until(viewport, lambda s: not engine.unsaved)
        assert "SSIM" not in until(viewport, lambda s: s.warning == OUTDATED).caption
        viewport.close()
    reopened = Scene.open(judged.root)
    with Engine(reopened, lambda: device, SETTINGS) as engine:
        viewport = Viewport(engine, VIEW, objects=reopened.views["ahead"].objects, frames=1)
        viewport.lens = Lens(against="truth")
        stale = until(viewport, lambda s: "Truth" in s.caption and s.shown.refined)
        assert (stale.warning, "SSIM" in stale.caption) == (OUTDATED, False)
        manifest = judged.root / "scene.toml"
        manifest.write_text(manifest.read_text().replace("truth_outdated = true\n", ""))
        until(viewport, lambda s: not s.warning and "SSIM" in s.caption)
        viewport.close()


RNG = np.random.default_rng(5)
COLOR, INPUT, OTHER = RNG.random((3, 24, 32, 3)).astype(np.float32)
NORMAL = RNG.normal(size=(24, 32, 3)).astype(np.float32)
SCENE: Any = SimpleNamespace(exposure=1.0, views={})


def shown(color: Any, method: str, *, plain: bool = False) -> Any:
    aovs = {} if plain else {"background": INPUT, "normal": NORMAL}
    return SimpleNamespace(
        picture=SimpleNamespace(color=color, aovs=aovs),
        plain=plain,
        refined=not plain,
        frame=0,
        request=SimpleNamespace(
            view="ahead", objects=None, settings=SimpleNamespace(method=method)
        ),
    )


def developed(developer: PictureDeveloper, lens: Lens, baseline: Any) -> Any:
    return developer.develop(SCENE, None, lens, shown(COLOR, "iprt"), baseline, None, ())


@pytest.fixture
def developer() -> Any:
    developer = PictureDeveloper()
    yield developer
    developer.close()


def scored(developer: PictureDeveloper, lens: Lens, baseline: Any) -> str:
    """The caption once its score is known."""
    before, end = developer.scores, time.monotonic() + DEADLINE_S
    developed(developer, lens, baseline)
    while developer.scores == before and time.monotonic() < end:
        time.sleep(0.01)
    caption: str = developed(developer, lens, baseline).caption
    return caption


def test_scores_are_of_what_is_compared(developer: PictureDeveloper) -> None:
    ibl = shown(OTHER, "ibl")
    for against, other in (("input", INPUT), ("ibl", OTHER)):
        value = metrics.ssim(*(display(image, 1.0) for image in (COLOR, other)))
        caption = scored(developer, Lens(against=against), ibl)
        assert caption.endswith(f", SSIM {value:.3f}")


def test_a_method_whose_kernels_compile_is_not_compared_with(developer: PictureDeveloper) -> None:
    """Meanwhile its picture is the input."""
    found = developed(developer, Lens(against="ibl", split=0.0), shown(INPUT, "ibl", plain=True))
    assert "ibl is being rendered" in found.caption
    assert "SSIM" not in found.caption
    assert found.sides is None
    np.testing.assert_array_equal(found.pixels, Lens().develop(COLOR, 1.0))


def test_buffers_have_no_score(developer: PictureDeveloper) -> None:
    lens = Lens(buffer="normal", against="input")
    scored(developer, Lens(against="input"), None)
    found = developed(developer, lens, None)
    assert found.buffer == "normal"
    assert "SSIM" not in found.caption
