"""Films: every frame once and in order, as the renderer makes it, with no more held than needed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.convergence import Goal
from iprt.device.compute import ComputeDevice
from iprt.errors import SceneError
from iprt.film import Film, memory_indices, warm_up_indices
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.output.display import display
from iprt.renderer import RenderedFrame, Renderer
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.world.real.real_world import RealWorld
from tests.clips import clip_color, write_clip
from tests.films import FEW
from tests.scene.files import write_rgb

SETTINGS = Settings.model_validate(FEW)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return Scene.open(write_clip(tmp_path_factory.mktemp("clip"), 24))


def film(scene: Scene, device: ComputeDevice, accumulate: int = 1) -> Film:
    return Film(scene, device, SETTINGS, view=scene.views["ahead"], accumulate=accumulate)


def pictures(
    scene: Scene, device: ComputeDevice, indices: Sequence[int], warm_up: int = 0
) -> list[NDArray[np.float32]]:
    with film(scene, device) as running:
        return [picture.color for _, picture in running.frames(indices, warm_up=warm_up)]


@pytest.mark.thorough
def test_a_goal_decides_how_many_frames_a_picture_has(scene: Scene, device: ComputeDevice) -> None:
    settings, view = SETTINGS.model_copy(update={"fading": 0.0}), scene.views["ahead"]
    goal, seen = Goal(0.003, 256, scene.exposure), list[int]()
    with Film(scene, device, settings, view=view) as running:
        ((_, picture),) = running.frames([1], aovs=["normal"], goal=goal, progress=seen.append)
    assert goal.met, goal.reached
    assert 2 < goal.frames < 256, goal.reached
    assert seen == list(range(1, goal.frames + 1))
    with Renderer(device, scene.frame(1), scene.instances, view.view, settings) as renderer:
        assert np.array_equal(picture.color, renderer.render(goal.frames).color)
        better = renderer.render(512 - goal.frames).color
    assert set(picture.aovs) == {"normal"}
    error = display(picture.color, scene.exposure) - display(better, scene.exposure)
    assert np.sqrt(np.mean(error**2)) < 3.0 * goal.noise


def test_frames_are_what_a_renderer_makes_of_the_video(scene: Scene, device: ComputeDevice) -> None:
    with film(scene, device, accumulate=2) as running:
        made = list(running.frames([1, 2, 4], aovs=["normal"]))
    assert [index for index, _ in made] == [1, 2, 4]
    view = scene.views["ahead"].view
    settings = SETTINGS.model_copy(update={"fading": SETTINGS.fading / np.sqrt(2.0)})
    with Renderer(device, scene.frame(1), scene.instances, view, settings) as renderer:
        expected = [renderer.render(2).color]
        for index in (2, 4):
            renderer.load(scene.frame(index))
            expected.append(renderer.render(2).color)
    for (_, picture), color in zip(made, expected, strict=True):
        assert np.array_equal(picture.color, color)
        assert set(picture.aovs) == {"normal"}
    assert np.abs(expected[1] - expected[0]).max() > 0.01


@pytest.mark.thorough
def test_exposure_and_white_balance_may_drift(tmp_path: Path, device: ComputeDevice) -> None:
    """Each frame equals the steady video's in its own colors; the setting turns that off."""
    steady = Scene.open(write_clip(tmp_path / "steady", 4))
    drifting = Scene.open(write_clip(tmp_path / "drifting", 4))
    gains = [np.array(gain) for gain in ((1.0, 1.0, 1.0), (1.5, 1.2, 1.0), (2, 2, 1.5), (1, 1, 1))]
    for number, gain in enumerate(gains):
        write_rgb(tmp_path / "steady" / f"color.{number:04d}.exr", clip_color(0))
        color = (clip_color(0) * gain).astype(np.float32)
        write_rgb(tmp_path / "drifting" / f"color.{number:04d}.exr", color)
    wanted, found = pictures(steady, device, range(4)), pictures(drifting, device, range(4))
    for picture, color, gain in zip(found, wanted, gains, strict=True):
        np.testing.assert_allclose(picture, color * gain, rtol=0.01, atol=1e-3)
    assert np.array_equal(found[0], wanted[0])
    off = SETTINGS.model_copy(update={"drift": False})
    with Film(drifting, device, off, view=drifting.views["ahead"]) as running:
        without = [picture.color for _, picture in running.frames(range(4))]
    assert np.array_equal(without[0], wanted[0])
    assert np.abs(without[1] / gains[1] - wanted[1]).max() > 0.03


def test_a_warm_up_is_the_frames_before(scene: Scene, device: ComputeDevice) -> None:
    """A warm-up from the start of a run continues it bit for bit."""
    whole = pictures(scene, device, range(6))
    assert np.array_equal(pictures(scene, device, [3, 4, 5], warm_up=3), whole[3:])
    assert not np.array_equal(pictures(scene, device, [3, 4, 5]), whole[3:])


@pytest.mark.parametrize(("accumulate", "expected"), [(1, [12, 1, 1]), (5, [10, 5, 5])])
def test_the_first_frame_of_a_video_is_repeated_without_loading_it_again(
    scene: Scene,
    device: ComputeDevice,
    monkeypatch: pytest.MonkeyPatch,
    accumulate: int,
    expected: list[int],
) -> None:
    steps: list[int] = []
    render = Renderer.render

    def rendering(self: Renderer, frames: int, *arguments: Any) -> RenderedFrame:
        steps.append(frames)
        return render(self, frames, *arguments)

    monkeypatch.setattr(Renderer, "render", rendering)
    with film(scene, device, accumulate) as running:
        list(running.frames([1], warm_up=16))
        assert steps == expected[:2]
        steps.clear()
        list(running.frames([0, 1], warm_up=16))
    assert steps == expected


@pytest.mark.parametrize(
    ("indices", "count", "expected"),
    [
        ([7, 9], 3, [4, 5, 6]),
        (range(7, 8), 3, [4, 5, 6]),
        (range(7, 8, 2), 3, [1, 3, 5]),
        (range(7, 20, 2), 4, [0, 1, 3, 5]),
        (range(2), 2, [0, 0]),
        (range(5, 2, -1), 2, [3, 4]),
        ([3], 0, []),
    ],
)
def test_warm_up_keeps_the_step_and_starts_with_the_video(
    indices: Sequence[int], count: int, expected: list[int]
) -> None:
    assert warm_up_indices(indices, count, 0) == expected


@pytest.mark.parametrize(
    ("before", "expected"),
    [
        ([], []),
        ([0, 0, 1, 2], []),
        ([40, 41, 42, 43], [8, 24, 32, 36]),
        ([41, 42], [9, 25, 33, 37, 39]),
    ],
)
def test_memory_reaches_far_back_with_few_frames(before: list[int], expected: list[int]) -> None:
    assert memory_indices(before, 0) == expected
    assert len(memory_indices(range(10**6, 10**6 + 8), 0)) == 10


def test_a_warm_up_gives_a_long_memory_what_it_needs(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Earlier frames are shown to the renderer, oldest first, and not rendered."""
    told: list[int | str] = []
    load, render = RealWorld._load, Renderer.render

    def loading(self: RealWorld, frame: Frame) -> None:
        told.append(frame.index)
        load(self, frame)

    def rendering(self: Renderer, *arguments: Any) -> RenderedFrame:
        told.append("rendered")
        return render(self, *arguments)

    monkeypatch.setattr(RealWorld, "_load", loading)
    monkeypatch.setattr(Renderer, "render", rendering)
    with film(scene, device) as running:
        assert [index for index, _ in running.frames([20], warm_up=2)] == [20]
    shown = told[1:] if told[:2] == [2, 2] else told  # once more where memory is planned
    assert shown == [2, 10, 14, 16, 18, "rendered", 19, "rendered", 20, "rendered"]


def test_no_such_frame(scene: Scene, device: ComputeDevice) -> None:
    with film(scene, device) as running, pytest.raises(SceneError, match="no frame 24"):
        list(running.frames([23, 24]))


def test_a_plain_view_shows_all_objects_and_others_what_is_named(
    scene: Scene, device: ComputeDevice
) -> None:
    view = View(16, 12, pitch_deg=-30.0)
    covered = []
    for objects in (None, ("cube",), ()):
        with Film(scene, device, SETTINGS, view=view, objects=objects) as running:
            ((_, picture),) = running.frames([0])
        covered.append(picture.color)
    assert np.array_equal(covered[0], covered[1])
    assert np.abs(covered[0] - covered[2]).max() > 0.05
