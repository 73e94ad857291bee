"""Bad moments: each is told, the last good picture stays, and the viewer goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iprt.device import compute as module
from iprt.device.compute import ComputeDevice
from iprt.errors import DeviceHangError, DeviceLostError, IprtError
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.scene import Scene
from iprt.viewer.core import POLL_S
from tests.viewer.turns import FEWEST, VIEW, turns

CLIP_FRAMES = 3


def rewrite(scene: Scene, before: str, after: str) -> None:
    """As an editor saves the scene's file: another one takes its place."""
    path = scene.root / "scene.toml"
    text = path.read_text()
    assert before in text
    other = path.with_suffix(".new")
    other.write_text(text.replace(before, after))
    other.rename(path)


@pytest.mark.thorough
def test_a_mesh_that_cannot_be_read_is_told(
    scene: Scene, device: ComputeDevice, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.ply"
    bad.write_text("no mesh")
    with turns(scene, device) as driver:
        client = driver.join()
        first = driver.answer(client)
        driver.core.add(ObjectEdit("bad", path=bad), (0.0, -40.0), MeshPose())
        driver.settle()
        (problem,) = driver.problems
        assert "bad.ply" in problem
        assert driver.shown(client) is first
        driver.core.add(
            ObjectEdit("good", path=scene.root / "cube.obj"), (40.0, -40.0), MeshPose(height_m=0.3)
        )
        driver.settle()
        assert driver.problems == ()
        added = driver.shown(client).geometry
    assert added is not None
    assert added.names == ("cube", "good")


def test_a_scene_whose_mesh_is_broken_is_shown_without(scene: Scene, device: ComputeDevice) -> None:
    (scene.root / "cube.obj").write_text("no mesh")
    with turns(Scene.open(scene.root), device) as driver:
        shown = driver.answer(driver.join())
        (problem,) = driver.problems
    assert "cube.obj" in problem
    assert shown.geometry is not None
    assert shown.geometry.names == ()


def test_a_video_that_cannot_be_read_is_told(scene: Scene, device: ComputeDevice) -> None:
    """Once it is mended, and the scene saved again, it is shown."""
    first = scene.root / "color.0000.exr"
    good = first.read_bytes()
    first.write_bytes(b"no picture")
    with turns(scene, device) as driver:
        client = driver.join()
        driver.until(lambda: bool(driver.problems))
        assert "color.0000.exr" in driver.problems[0]
        driver.until(lambda: driver.shared.status.doing == "waiting")
        first.write_bytes(good)
        rewrite(scene, "fps = 24.0", "fps = 25.0")
        driver.clock.now += POLL_S
        driver.answer(client)
        assert driver.problems == ()


def devices(device: ComputeDevice) -> tuple[list[ComputeDevice], Callable[[], ComputeDevice]]:
    """All devices that are made, and what makes another one."""
    made: list[ComputeDevice] = []

    def make() -> ComputeDevice:
        made.append(ComputeDevice(device.device))
        return made[-1]

    return made, make


class Fails:
    """Lets launches of the kernel `composite` fail as those of a lost device do."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.times = 0
        self.error: IprtError = DeviceLostError("the device gave up")
        launch = module.Kernel.__call__

        def failing(kernel: module.Kernel, *args: Any, **named: Any) -> None:
            if self.times and kernel.name == "composite":
                self.times -= 1
                raise self.error
            launch(kernel, *args, **named)

        monkeypatch.setattr(module.Kernel, "__call__", failing)


@pytest.mark.thorough
def test_a_lost_device_is_made_anew_once(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, make = devices(device)
    fails = Fails(monkeypatch)
    with turns(scene, make, FEWEST) as driver:
        client = driver.join()
        first = driver.answer(client)
        fails.times = 1
        again = driver.answer(client, driver.ask(client, frames=2))
        assert len(made) == 2
        assert np.array_equal(again.picture.color, first.picture.color)
        assert driver.problems == ()
        fails.times = 2
        driver.ask(client, view=replace(VIEW, yaw_deg=1.0))
        driver.settle()
        (problem,) = driver.problems
        assert "for the second time" in problem
        assert driver.shown(client).request == again.request
        driver.answer(client, driver.ask(client))
        assert driver.problems == ()


@pytest.mark.thorough
def test_a_device_that_hangs_is_left_alone(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No second try of what it hung at, which would take as long; the next request gets another
    device."""
    made, make = devices(device)
    fails = Fails(monkeypatch)
    with turns(scene, make, FEWEST) as driver:
        client = driver.join()
        first = driver.answer(client)
        fails.error, fails.times = DeviceHangError("has not answered for 60 s"), 1
        driver.ask(client, view=replace(VIEW, yaw_deg=1.0))
        driver.settle()
        assert driver.problems == ("has not answered for 60 s",)
        assert driver.shared.status.doing == "waiting"
        assert (fails.times, len(made)) == (0, 1)
        assert driver.shown(client) is first
        again = driver.answer(client, driver.ask(client))
        assert len(made) == 2
        assert driver.problems == ()
    assert np.array_equal(again.picture.color, first.picture.color)


def test_a_device_that_cannot_be_had_is_told(scene: Scene, device: ComputeDevice) -> None:
    there = False

    def make() -> ComputeDevice:
        if not there:
            raise DeviceLostError("no device")
        return device

    with turns(scene, make) as driver:
        client = driver.join()
        driver.settle()
        assert driver.problems[0].startswith("no device")
        there = True
        driver.answer(client, driver.ask(client))
        assert driver.problems == ()


@pytest.mark.thorough
def test_a_view_that_does_not_fit_is_told(scene: Scene, device: ComputeDevice) -> None:
    with turns(scene, device) as driver:
        client = driver.join()
        first = driver.answer(client)
        driver.ask(client, view=VIEW.resized(16384, 16384))
        driver.settle()
        (problem,) = driver.problems
        assert "16384 x 16384" in problem
        assert driver.shown(client) is first
        driver.answer(client, driver.ask(client))
        assert driver.problems == ()


def test_a_defect_is_told_and_the_viewer_goes_on(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    with turns(scene, device) as driver:
        client = driver.join()
        first = driver.answer(client)
        with monkeypatch.context() as patch:
            patch.setattr("iprt.viewer.accumulating_renderer.Renderer.render", lambda *_: 1 / 0)
            driver.ask(client)
            driver.settle()
        (problem,) = driver.problems
        assert "ZeroDivisionError" in problem
        assert driver.shown(client) is first
        driver.answer(client, driver.ask(client))
        assert driver.problems == ()
