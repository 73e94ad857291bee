"""The engine as viewers use it: from other threads, which never wait for the device."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.renderer import Renderer
from iprt.scene.placement import bounds, set_on
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from iprt.viewer.state import Playback, Request
from tests.scene.files import HIGH, LOW
from tests.viewer.turns import SETTINGS, VIEW
from tests.waiting import DEADLINE_S

CLIP_FRAMES = 4


def engine_of(scene: Scene, device: ComputeDevice) -> Engine:
    return Engine(scene, lambda: device, SETTINGS)


def test_input_is_answered_within_two_frames(
    scene: Scene, device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A burst of input that comes during a frame costs the rest of it and one more."""
    begun, allowed = threading.Semaphore(0), threading.Semaphore(0)
    step = Renderer.step

    def held(renderer: Renderer) -> None:
        begun.release()
        assert allowed.acquire(timeout=DEADLINE_S)
        step(renderer)

    def frame() -> None:
        """The frame under way is finished; the next one begins."""
        allowed.release()
        assert begun.acquire(timeout=DEADLINE_S)

    monkeypatch.setattr(Renderer, "step", held)
    with engine_of(scene, device) as engine:
        client = engine.client(Request(VIEW, frames=10_000))
        assert begun.acquire(timeout=DEADLINE_S)
        for turn in range(20):
            for part in range(10):
                view = replace(VIEW, yaw_deg=turn + 0.1 * part)
                client.ask(Request(view, frames=10_000))
            frame()
            frame()
            shown = client.shown
            assert shown is not None
            assert shown.request.view == view
        allowed.release(2)
    assert not engine._thread.is_alive()


def test_closing_ends_all_threads(scene: Scene, device: ComputeDevice) -> None:
    engine = engine_of(scene, device)
    client = engine.client(Request(VIEW, frames=10_000))
    assert client.wait(0, DEADLINE_S) is not None
    engine.play()
    engine.close()
    assert engine.status.doing == "closed"
    names = {thread.name for thread in threading.enumerate()}
    assert not any(n.startswith(("iprt viewer", "iprt frames", "iprt loading")) for n in names)
    assert client.wait(10**9, DEADLINE_S) is None


def test_what_is_at_a_pixel(scene: Scene, device: ComputeDevice) -> None:
    """The floor where the room is known to have it, with the object in front of it."""
    view = View(33, 17, pitch_deg=-35.0)
    with engine_of(scene, device) as engine:
        client = engine.client(Request(view, frames=1))
        shown = client.wait(0, DEADLINE_S)
    assert shown is not None
    geometry = shown.geometry
    assert geometry is not None
    object_pixel = tuple(int(v) for v in view.project(np.array([0.1, -0.75, -1.5])))
    assert geometry.object_at(*object_pixel) == "cube"
    seen, behind = geometry.seen(*object_pixel), geometry.real(*object_pixel)
    assert seen is not None
    assert behind is not None
    assert seen.depth_m < behind.depth_m
    floor = next((x, y) for x, y in ((1, 16), (31, 16)) if geometry.object_at(x, y) is None)
    surface = geometry.seen(*floor)
    assert surface is not None
    direction = view.directions()[floor[1], floor[0]]
    with np.errstate(divide="ignore"):
        depth = np.where(direction > 0, HIGH / direction, LOW / direction).min()
    np.testing.assert_allclose(surface.depth_m, depth, rtol=0.05)
    np.testing.assert_allclose(surface.point, surface.depth_m * direction, rtol=1e-5)
    assert surface.normal[1] > 0.9


def test_things_stand_where_they_are_dropped(scene: Scene) -> None:
    corners = bounds(scene.instances[0].mesh)
    to_world = scene.instances[0].to_world
    for normal in ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.0, 0.8)):
        up, point = np.array(normal), np.array([0.3, -1.2, -2.0])
        placed = set_on(to_world, corners, point, up)
        corner = np.stack(np.meshgrid(*np.stack(corners).T), -1).reshape(-1, 3)
        height = (corner @ placed[:3, :3].T + placed[:3, 3] - point) @ up
        assert height.min() == pytest.approx(0.0, abs=1e-9)
        assert height.max() == pytest.approx(0.6)
        assert np.linalg.det(placed[:3, :3]) == pytest.approx(0.3**3)
    upright = set_on(to_world, corners, point)
    assert np.array_equal(upright[:3, :3], to_world[:3, :3])


def test_the_video_is_steered(scene: Scene, device: ComputeDevice) -> None:
    now = [50.0]
    engine = Engine(scene, lambda: device, SETTINGS, clock=lambda: now[0])
    with engine:
        engine.seek(2)
        assert engine.playback == Playback(2)
        engine.play()
        now[0] += 0.5 / 24.0
        engine.pause()
        assert engine.playback == Playback(2)
        engine.play()
        now[0] += 10.0
        engine.pause()
        assert engine.playback == Playback(3)
        engine.play()
        assert engine.playback == Playback(0, now[0])
        engine.seek(99)
        assert engine.playback == Playback(3, now[0])
