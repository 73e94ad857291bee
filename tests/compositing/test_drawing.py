"""The choice between OpenGL and rays, and the host's work in a steady frame."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.compositing import drawing
from iprt.device.compute import ComputeDevice
from iprt.device.fastest import ROUNDS, timed_ways
from iprt.errors import DeviceError
from iprt.footage.properties import Footage
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.films import films
from tests.like_gpu import LikeGpu, traffic

CONSTANTS = 16 * 4
"""Bytes of what a turned view changes: `View.kernel_constants`."""


def renderer(device: ComputeDevice, name: str, **settings: Any) -> Renderer:
    film = films(**settings)[name]
    footage = Footage.of(film.video[0], static_camera=film.static_camera)
    return Renderer(device, film.video[0], film.objects, film.view, film.settings, footage=footage)


def picture(device: ComputeDevice, gbuffer: str) -> Any:
    with renderer(device, "environment", gbuffer=gbuffer) as found:
        return found.render(2).color


def test_by_itself_a_cpu_has_rays_draw(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is timed: two runs are alike."""

    def decide(*_: Any) -> None:
        raise AssertionError("timed")

    monkeypatch.setattr(drawing, "timed_ways", decide)
    assert Settings().gbuffer == "auto"
    np.testing.assert_array_equal(picture(device, "auto"), picture(device, "cl"))


@pytest.mark.parametrize(("faster", "same_as"), [("OpenGL", "gl"), ("rays", "cl")])
def test_elsewhere_the_faster_one_draws_and_the_other_is_gone(
    gpu: LikeGpu,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    faster: str,
    same_as: str,
) -> None:
    def times(device: ComputeDevice, ways: Any) -> dict[str, float]:
        assert set(timed_ways(device, ways)) == {"OpenGL", "rays"}
        return {name: 1.0 if name == faster else 2.0 for name in ways}

    monkeypatch.setattr(drawing, "timed_ways", times)
    with caplog.at_level("DEBUG", "iprt"):
        found = picture(gpu, "auto")
    (record,) = caplog.records
    assert f"by {faster}" in record.getMessage()
    assert bool(gpu.opengl) is (faster == "OpenGL")
    assert ("traced front" in gpu.buffers) is (faster == "rays")
    np.testing.assert_array_equal(found, picture(gpu, same_as))


def test_it_is_decided_once_and_when_objects_are_in_view(
    gpu: LikeGpu, monkeypatch: pytest.MonkeyPatch
) -> None:
    decided = []

    def times(_: ComputeDevice, ways: Any) -> dict[str, float]:
        decided.append(list(ways))
        return {"OpenGL": 1.0, "rays": 2.0}

    monkeypatch.setattr(drawing, "timed_ways", times)
    with renderer(gpu, "environment") as found, renderer(gpu, "environment", gbuffer="gl") as known:
        there = found.view
        for turn, decisions in ((180.0, 0), (180.0, 0), (0.0, 1), (4.0, 1)):
            for each in (found, known):
                each.look(replace(there, yaw_deg=turn, pitch_deg=0.0 if turn == 180.0 else -35.0))
            pictures = [each.render(1).color for each in (found, known)]
            assert len(decided) == decisions
            np.testing.assert_array_equal(*pictures)


def test_without_opengl_rays_draw_and_nobody_is_bothered(
    gpu: LikeGpu, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def missing(*_: Any) -> None:
        raise DeviceError("no EGL")

    monkeypatch.setattr("iprt.raster.rasterizer.create_context", missing)
    found = picture(gpu, "auto")
    assert not caplog.records
    np.testing.assert_array_equal(found, picture(gpu, "cl"))


def test_ways_are_timed_until_the_device_has_finished(monkeypatch: pytest.MonkeyPatch) -> None:
    """Medians, and without the first time."""
    now = 0.0
    enqueued = 0.0
    costs = {"a": iter([100.0, 5.0, 50.0, 4.0]), "b": iter([0.0, 6.0, 6.0, 6.0])}

    class Device:
        def wait(self) -> None:
            nonlocal now, enqueued
            now, enqueued = now + enqueued, 0.0

    def way(name: str) -> None:
        nonlocal enqueued
        enqueued += 1e-3 * next(costs[name])

    monkeypatch.setattr("iprt.device.fastest.time.perf_counter", lambda: now)
    times = timed_ways(Device(), {name: lambda name=name: way(name) for name in costs})
    assert times == pytest.approx({"a": 5.0, "b": 6.0})
    assert ROUNDS == 3
    assert all(next(left, None) is None for left in costs.values())


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["triangles", "remembered", "published", "environment"])
def test_in_a_steady_frame_the_host_only_tells_where_the_view_looks(
    gpu: LikeGpu, name: str
) -> None:
    """No transfer but the view's constants, and no wait; in a still frame nothing at all."""
    with renderer(gpu, name, gbuffer="cl") as found:
        for turn in range(3):
            found.look(replace(found.view, yaw_deg=float(turn)))
            found.step()
        gpu.wait()
        with traffic() as turning:
            for turn in range(3, 6):
                found.look(replace(found.view, yaw_deg=float(turn)))
                found.step()
        with traffic() as still:
            found.step()  # the view of the frame before is another one still
            found.step()
        gpu.wait()
    assert turning.reads == []
    assert turning.waits == 0
    assert turning.uploads
    assert max(turning.uploads) <= CONSTANTS
    assert sum(turning.uploads) <= 3 * 2 * CONSTANTS
    assert still.reads == []
    assert still.waits == 0
    assert sum(still.uploads) <= 2 * CONSTANTS


def test_traffic_is_seen(gpu: LikeGpu) -> None:
    array = gpu.zeros("traffic", (4,))
    with traffic() as seen:
        gpu.write(array, np.ones(4, np.float32))
        gpu.read(array)
        gpu.wait()
    assert seen.uploads == [16]
    assert seen.reads == [16]
    assert seen.waits >= 3
