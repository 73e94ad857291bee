"""`iprt bench`: what counts, over which frames, and that every frame is a new direction."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.profile import Profile
from iprt.geometry.camera import View
from iprt.measure import bench as bench_module
from iprt.measure.bench import FEWEST_ROUNDS, WARM_UP, timed, timed_together
from iprt.measure.camera_motion import TURN_DEG, Turn, to_and_fro, turned
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from tests.profiles import frame, launch

ROOM = Path(__file__).parents[2] / "scenes360" / "room"
VIEW = View(40, 30, yaw_deg=10.0)
NOTHING: Any = (None, ())
"""Frame and objects of a renderer that looks at neither."""


class FakeRenderer:
    """Frame i takes i milliseconds; the warm-up a second each, the panorama 7 ms."""

    seen: list[View]
    now_s: float

    def __init__(self, device: Any, *_: Any) -> None:
        self.device = device
        count = SimpleNamespace(get=lambda: np.array([300], np.int32))
        self.method = SimpleNamespace(traced_count=count)
        self.view = VIEW
        launch(device.profile, "surface", "build", 7.0)

    def __enter__(self) -> FakeRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def look(self, view: View) -> None:
        self.seen.append(view)

    def step(self) -> None:
        index = len(self.seen) - WARM_UP
        ms = 1000.0 if index <= 0 else float(index)
        frame(self.device.profile, {"march": ms})
        FakeRenderer.now_s += 1e-3 * ms


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Any:
    module = ModuleType("iprt.renderer")
    vars(module)["Renderer"] = FakeRenderer
    monkeypatch.setitem(sys.modules, "iprt.renderer", module)
    monkeypatch.setattr(FakeRenderer, "seen", [], raising=False)
    monkeypatch.setattr(FakeRenderer, "now_s", 0.0, raising=False)
    monkeypatch.setattr(bench_module.time, "perf_counter", lambda: FakeRenderer.now_s)
    return SimpleNamespace(
        name="a device",
        profile=Profile(),
        buffers={},
        opengl={},
        memory=2**30,
        finish=lambda: None,
        wait=lambda: None,
    )


class SlowingRenderer(FakeRenderer):
    """Frames of seed 0 take 2 ms, of others 3, and longer and longer."""

    def __init__(self, device: Any, *given: Any) -> None:
        super().__init__(device)
        self.ms = 3.0 if given[3].seed else 2.0

    def look(self, view: View) -> None:
        del view

    def step(self) -> None:
        ms = self.ms * (1.0 + 5.0 * FakeRenderer.now_s)
        frame(self.device.profile, {"march": self.ms})
        FakeRenderer.now_s += 1e-3 * ms


def test_a_machine_that_slows_down_leaves_the_ratio(
    fake: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["iprt.renderer"], "Renderer", SlowingRenderer)
    base, other = (Turn(*NOTHING, VIEW, Settings(seed=seed)) for seed in (0, 1))
    report, ratio = timed(fake, other, scene="room", frames=48, base=base)
    # The second of a pair comes a little later.
    assert ratio is not None
    assert 1.5 < ratio.value < 1.52
    (first, _), (second, _) = (timed(fake, turn, scene="room", frames=48) for turn in (base, other))
    assert second.wall_ms / first.wall_ms > 1.7
    # Passes are those of the other's frames alone.
    assert report.frames == 48
    (march,) = (row for row in report.passes if row.name == "march")
    assert march.timing.ms == pytest.approx(3.0)


def test_reels_take_turns_until_it_is_enough(fake: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["iprt.renderer"], "Renderer", SlowingRenderer)
    reels = [Turn(*NOTHING, VIEW, Settings(seed=seed)) for seed in (0, 1, 1)]
    asked: list[int] = []

    def enough(rounds: int) -> bool:
        asked.append(rounds)
        return rounds == 24

    first, *others = timed_together(fake, reels, enough)
    assert asked == [0] * WARM_UP + list(range(1, 25))
    assert [len(walls) for walls in (first, *others)] == [24] * 3
    # All slow down alike, the later one of a round a little more.
    for walls in others:
        assert np.divide(walls, first) == pytest.approx(1.5, rel=0.05)
    assert first[-1] > 1.5 * first[0]

    def late(rounds: int) -> bool:
        asked.append(rounds)
        return True

    asked.clear()
    assert [len(walls) for walls in timed_together(fake, reels, late)] == [FEWEST_ROUNDS] * 3
    assert asked == [0] * (WARM_UP // 2 + FEWEST_ROUNDS)
    assert not fake.profile.passes()


def test_medians_leave_out_warm_up_and_preparation(fake: Any) -> None:
    result, ratio = timed(fake, Turn(*NOTHING, VIEW, Settings()), scene="room", frames=6)
    (march,) = result.passes
    assert (march.name, march.timing.ms, march.share, march.launches) == ("march", 3.5, 1.0, 1.0)
    assert ratio is None
    assert result.frame.ms == 3.5
    assert result.prepare_ms == 7.0
    assert result.traced == 300 / (40 * 30)
    assert result.wall_ms == pytest.approx(3.5)
    assert (result.frames, result.scene, result.view) == (6, "room", VIEW)
    assert len(FakeRenderer.seen) == WARM_UP + 6


def test_the_head_turns_in_every_frame_and_keeps_the_objects_in_view(fake: Any) -> None:
    timed(fake, Turn(*NOTHING, VIEW, Settings()), scene="room", frames=300)
    yaws = np.array([view.yaw_deg for view in FakeRenderer.seen])
    assert np.allclose(np.abs(np.diff(yaws)), TURN_DEG)
    assert yaws[0] == VIEW.yaw_deg
    assert np.abs(yaws - VIEW.yaw_deg).max() == pytest.approx(5.0)
    assert abs(yaws.mean() - VIEW.yaw_deg) < 0.5


def test_a_short_video_plays_to_and_fro() -> None:
    assert to_and_fro(range(3, 6), 8) == [3, 4, 5, 4, 3, 4, 5, 4]
    assert to_and_fro(range(3, 60), 4) == [3, 4, 5, 6]
    assert to_and_fro(range(7, 9), 5) == [7, 8, 7, 8, 7]


def test_an_equirect_view_does_not_turn() -> None:
    view = View(64, 32, projection="equirect")
    assert all(turned(view, index) == view for index in range(200))


@pytest.mark.thorough
@pytest.mark.gl
def test_every_frame_does_all_that_a_new_direction_asks_for(device: ComputeDevice) -> None:
    scene = Scene.open(ROOM)
    view = scene.views["room"].view.resized(48, 32)
    given = (scene.frame(), scene.instances, view, Settings(gbuffer="gl"))
    result, _ = timed(device, Turn(*given), scene=scene.name, frames=3)
    rows = {row.name: row for row in result.passes}
    assert rows["draw objects"].host_ms > 0.0
    once_a_frame = {"trace real", "trace virtual", "relight", "composite"}
    # The panorama is resampled in two kernels, sharpened at edges, and split into highlights and
    # the rest. The drawn objects are uploaded and unpacked.
    launches = {"resample": 4.0, "draw objects": 2.0, **dict.fromkeys(once_a_frame, 1.0)}
    assert {name: rows[name].launches for name in launches} == launches
    assert all(rows[name].device_ms > 0.0 for name in launches)
    assert rows.keys().isdisjoint({"surfaces", "draw layers around"})
    assert result.traced is not None
    assert 0.0 < result.traced <= 1.0
