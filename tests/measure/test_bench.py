"""`iprt bench`: what counts, over which frames, and that every frame is a new direction."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from iprt.commands.bench import bench, bench_table
from iprt.device.compute import ComputeDevice
from iprt.device.profile import PassTime, Profile
from iprt.errors import IprtError
from iprt.measure import bench as measured
from iprt.measure.bench import TURN_DEG, WARM_UP, benchmark, median_rows, turned
from iprt.output.table import PassRow
from iprt.scene.camera import View
from iprt.scene.scene import Scene
from iprt.settings import Settings

ROOM = Path(__file__).parents[2] / "scenes360" / "room"
VIEW = View(40, 30, yaw_deg=10.0)


class FakeProfile(Profile):
    """One pass, which takes as many milliseconds as the renderer says."""

    times: list[float]

    def passes(self) -> list[PassTime]:
        return [PassTime("march", sum(self.times), 0.0, len(self.times))]

    def reset(self) -> None:
        super().reset()
        self.times = []


class FakeRenderer:
    """Frame i takes i milliseconds; the warm-up a second each, the panorama 7 ms."""

    seen: list[View]

    def __init__(self, device: Any, *_: Any) -> None:
        self.device = device
        self.real_pixels = SimpleNamespace(mask=SimpleNamespace(count=None))
        self.view = VIEW
        device.profile.times.append(7.0)

    def __enter__(self) -> FakeRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def look(self, view: View) -> None:
        self.seen.append(view)

    def step(self) -> None:
        index = len(self.seen) - WARM_UP
        self.device.profile.times.append(1000.0 if index <= 0 else float(index))
        self.device.profile.frames += 1


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Any:
    module = ModuleType("iprt.renderer")
    vars(module)["Renderer"] = FakeRenderer
    monkeypatch.setitem(sys.modules, "iprt.renderer", module)
    monkeypatch.setattr(FakeRenderer, "seen", [], raising=False)
    return SimpleNamespace(
        name="a device",
        profile=FakeProfile(),
        finish=lambda: None,
        queue=SimpleNamespace(finish=lambda: None),
        read=lambda _: np.array([300], np.int32),
    )


def test_medians_leave_out_warm_up_and_preparation(fake: Any) -> None:
    result = benchmark(fake, None, (), VIEW, Settings(), frames=6)  # type: ignore[arg-type]
    (march,) = result.passes
    assert (march.name, march.ms, march.share, march.launches) == ("march", 3.5, 1.0, 1.0)
    assert result.ms == 3.5
    assert result.prepare_ms == 7.0
    assert result.traced == 300 / (40 * 30)
    assert 0.0 < result.wall_ms < 100.0
    assert len(FakeRenderer.seen) == WARM_UP + 6


def test_the_head_turns_in_every_frame_and_keeps_the_objects_in_view(fake: Any) -> None:
    benchmark(fake, None, (), VIEW, Settings(), frames=300)  # type: ignore[arg-type]
    yaws = np.array([view.yaw_deg for view in FakeRenderer.seen])
    assert np.allclose(np.abs(np.diff(yaws)), TURN_DEG)
    assert yaws[0] == VIEW.yaw_deg
    assert np.abs(yaws - VIEW.yaw_deg).max() == pytest.approx(5.0)
    assert abs(yaws.mean() - VIEW.yaw_deg) < 0.5


def test_an_equirect_view_does_not_turn() -> None:
    view = View(64, 32, projection="equirect")
    assert all(turned(view, index) == view for index in range(200))


def test_a_pass_that_most_frames_lack_has_a_median_of_zero() -> None:
    always = PassRow("march", 4.0, 0.5, 3.0, 1.0, 2.0)
    once = PassRow("panorama", 9.0, 0.5, 9.0, 0.0, 1.0)
    march, panorama = median_rows([[always, once], [always], [always]])
    assert march == PassRow("march", 4.0, 1.0, 3.0, 1.0, 2.0)
    assert (panorama.ms, panorama.share, panorama.launches) == (0.0, 0.0, 0.0)


def test_table_tells_frame_rate_and_traced_share() -> None:
    row = PassRow("march", 4.0, 1.0, 4.0, 0.0, 1.0)
    result = measured.Benchmark("a device", "iprt", 40, 30, 6, 5.0, 4.0, 0.25, 7.0, 9.0, (row,))
    stream = io.StringIO()
    Console(file=stream, width=80).print(bench_table(result))
    text = stream.getvalue()
    for part in ("40x30", "6 frames on a device", "5.00 ms/frame", "200.0 frames/s", "25.0%"):
        assert part in text


@pytest.mark.parametrize("frames", [0, -3, 100_001])
def test_frames_out_of_range_are_refused(frames: int) -> None:
    with pytest.raises(IprtError, match=f"--frames {frames}: expected 1 to"):
        bench(ROOM, frames=frames)


@pytest.mark.gl
def test_every_frame_does_all_that_a_new_direction_asks_for(device: ComputeDevice) -> None:
    scene = Scene.open(ROOM)
    view = scene.views["room"].view.resized(48, 32)
    result = benchmark(device, scene.frame(), scene.instances, view, Settings(), frames=3)
    rows = {row.name: row for row in result.passes}
    assert rows["rasterize view"].host_ms > 0.0
    once_a_frame = {"unpack", "trace real", "trace virtual", "relight", "composite"}
    # Colours are resampled, then split into highlights and the rest.
    launches = {"resample": 2.0, **dict.fromkeys(once_a_frame, 1.0)}
    assert {name: rows[name].launches for name in launches} == launches
    assert all(rows[name].device_ms > 0.0 for name in launches)
    assert rows.keys().isdisjoint({"surface", "rasterize panorama"})
    assert result.traced is not None
    assert 0.0 < result.traced <= 1.0
    assert json.loads(json.dumps(result.record()))["passes"][0]["name"] == result.passes[0].name
