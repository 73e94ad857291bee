"""The profile: what it adds up to, what belongs to which frame, and when things ran."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from iprt.device import profile as profile_module
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.profile import MOST_FRAMES, MOST_PENDING, Key, Kind, PassTime, Profile
from tests.profiles import MS, FakeEvent, frame, launch

ROOT = Path(__file__).parents[2]


class HostClock:
    """What profiles take for the host's time; it stands still until the test moves it."""

    ns = 0

    def wait(self, ms: float) -> None:
        self.ns += round(ms * MS)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> HostClock:
    made = HostClock()
    monkeypatch.setattr(profile_module.time, "perf_counter_ns", lambda: made.ns)
    monkeypatch.setattr(profile_module.time, "perf_counter", lambda: made.ns * 1e-9)
    return made


def test_passes_are_sums_over_frames() -> None:
    profile = Profile()
    for _ in range(3):
        launch(profile, "march", "trace", 2.0)
        launch(profile, "march", "fill", 0.5, kind=Kind.TRANSFER)
        launch(profile, "blend", "mix", 1.0)
        profile.end_frame()
    launch(profile, "blend", "mix", 4.0)  # of a frame that has not ended
    assert profile.frames == 3
    assert profile.passes() == [PassTime("march", 7.5, 0.0, 6), PassTime("blend", 7.0, 0.0, 4)]
    assert profile.passes()[0].ms == 7.5


def test_costs_are_kept_frame_by_frame() -> None:
    profile = Profile()
    frame(profile, {"march": 2.0})
    frame(profile, {"march": 3.0, "blend": 1.0})
    launch(profile, "march", "march", 9.0)
    kept = [
        {key: cost.ms for key, cost in costs.items() if key.kind is Kind.KERNEL}
        for costs in profile.kept_frames()
    ]
    march, blend = (Key(name, name, Kind.KERNEL) for name in ("march", "blend"))
    assert kept == [{march: 2.0}, {march: 3.0, blend: 1.0}]
    profile.end_frame()
    profile.end_frame()  # of nothing
    assert [len(costs) > 0 for costs in profile.kept_frames()] == [True, True, True, False]


def test_launches_and_bytes_of_a_kernel_add_up() -> None:
    profile = Profile()
    for size in (10, 30):
        launch(profile, "filter", "level", 1.0, size)
    launch(profile, "filter", "write", 0.25, 7, Kind.TRANSFER)
    profile.end_frame()
    (costs,) = profile.kept_frames()
    level = costs[Key("filter", "level", Kind.KERNEL)]
    assert (level.ms, level.launches, level.bytes) == (2.0, 2, 40)
    assert costs[Key("filter", "write", Kind.TRANSFER)].bytes == 7


def test_a_pass_within_a_pass_is_part_of_it() -> None:
    profile = Profile()
    with profile.section("outer"):
        launch(profile, "inner", "kernel", 1.0)
        assert profile.current == "outer"
    assert profile.current == "other"
    assert [entry.name for entry in profile.passes()] == ["outer"]


def test_host_work_counts_and_waiting_for_the_device_does_not(clock: HostClock) -> None:
    profile = Profile()
    with profile.host("draw"):
        clock.wait(20.0)
    with profile.section("march"):
        clock.wait(30.0)
        launch(profile, "march", "trace", 1.0)
    draw, march = profile.passes()
    assert draw.device_ms == 0.0
    assert draw.host_ms == 20.0
    assert (march.device_ms, march.host_ms, march.launches) == (1.0, 0.0, 1)
    assert profile.totals()[Key("march", "march", Kind.ENQUEUE)].ms == 30.0


def test_preparation_is_forgotten_and_compiling_is_not(clock: HostClock) -> None:
    profile = Profile()
    with profile.compiling("a.cl -DX=1"):
        clock.wait(10.0)
    with profile.compiling("a.cl"):
        pass
    launch(profile, "surface", "build", 5.0)
    assert profile.prepared() == 5.0
    assert (profile.frames, profile.passes(), profile.kept_frames()) == (0, [], [])
    assert list(profile.compiled) == ["a.cl -DX=1", "a.cl"]
    assert profile.compile_ms == pytest.approx(10.0)


def test_events_are_read_once_there_are_many() -> None:
    profile = Profile()
    for _ in range(MOST_PENDING // 2 - 1):
        frame(profile, {"march": 2.0})  # with the section, two of them
        profile.finished()
    assert len(profile._pending) == MOST_PENDING - 2
    frame(profile, {"march": 2.0})
    profile.finished()
    assert not profile._pending
    assert profile.passes()[0].device_ms == pytest.approx(MOST_PENDING)


def test_what_a_first_launch_ran_is_not_compiling() -> None:
    profile = Profile()
    for program, ms in (("a.cl", 30.0), ("b.cl", 10.0), ("a.cl", 9.0), ("b.cl", 7.9)):
        profile.launched_first(program, FakeEvent(5 * MS, 13 * MS), ms)
    assert profile.first_launches == {"a.cl": 23.0, "b.cl": 2.0}


class SlowKernel:
    """The first launch takes 30 ms of the host; every one runs for 8 ms of the device's clock."""

    def __init__(self, clock: HostClock) -> None:
        self.clock, self.pause = clock, 30.0

    def get_work_group_info(self, *_: object) -> int:
        return 64

    def enqueue(self) -> FakeEvent:
        self.clock.wait(self.pause)
        self.pause = 0.0
        return FakeEvent(5 * MS, 13 * MS)


def test_what_only_the_first_launch_takes_is_told_by_program(
    device: ComputeDevice, clock: HostClock
) -> None:
    device.finish()
    enqueue = mock.patch(
        "pyopencl.enqueue_nd_range_kernel", lambda _, kernel, *__: kernel.enqueue()
    )
    with enqueue, mock.patch.object(device, "profile", Profile()) as profile:
        slow, other = SlowKernel(clock), SlowKernel(clock)
        program = f"slow.cl -DX={id(slow)}"
        with mock.patch.object(profile, "launched_first", wraps=profile.launched_first) as told:
            for _ in range(3):
                Kernel(device, lambda: slow, "slow", program, ())((64,))
        assert told.call_count == 1
        assert list(profile.first_launches) == [program]
        first = profile.first_launches[program]
        assert first == pytest.approx(30.0 - 8.0)
        Kernel(device, lambda: other, "slow", f"{program}1", ())((64,))
        with profile.compiling(program):
            clock.wait(10.0)
        assert profile.first_launches[program] == first
        assert profile.compile_ms == pytest.approx(10.0 + 2 * 22.0)
        profile.reset()
        assert profile.compile_ms == pytest.approx(10.0 + 2 * 22.0)


COMPILED = """
import os, sys
from pathlib import Path
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice

def tell(when):
    print(when, len(list(Path(os.environ["POCL_CACHE_DIR"]).rglob("reduce_range*.so"))))

for _ in range(2):
    device = ComputeDevice(choose_device(sys.argv[1]))
    told = device.profile.launched_first
    device.profile.launched_first = lambda *launch: (tell("told"), told(*launch))
    kernel = device.kernel("world/real/pyramid.cl", "reduce_range")
    ranges = device.zeros("ranges", (4 * 2 + 2 * 1, 2))
    tell("built")
    for _ in range(2):
        kernel((2, 1), columns=4, rows=2, fine=0, coarse=8, first=0, count=1, range=ranges)
    device.finish()
    tell("launched")
    assert list(device.profile.first_launches) == list(device.profile.compiled)
"""
"""Prints how many compiled kernels PoCL's cache holds, as two devices build and launch one."""


def test_pocl_compiles_at_the_first_launch_unless_its_cache_knows(
    device: ComputeDevice, tmp_path: Path
) -> None:
    """What PoCL writes tells when it compiles, on a machine however busy."""
    if "Portable" not in device.device.platform.name:
        pytest.skip("other drivers compile when they build, or when they like")
    result = subprocess.run(
        [sys.executable, "-c", COMPILED, "pocl"],
        cwd=ROOT,
        env={**os.environ, "POCL_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    cold = ["built 0", "told 1", "launched 1"]
    known = ["built 1", "told 1", "launched 1"]
    assert result.stdout.splitlines() == cold + known, result.stderr


def test_of_hours_as_many_frames_are_kept_from_all_times() -> None:
    """Totals stay exact; every eighth frame costs more, and is no more likely to be kept."""
    profile = Profile()
    count = 20 * MOST_FRAMES
    for index in range(count):
        frame(profile, {"march": 9.0 if index % 8 == 0 else 1.0})
        profile.resolve()
    assert profile.passes()[0].device_ms == pytest.approx(count * 2.0)
    key = Key("march", "march", Kind.KERNEL)
    kept = np.array([costs[key].ms for costs in profile.kept_frames()])
    assert len(kept) == MOST_FRAMES
    assert abs(kept.mean() - 2.0) < 4.0 * kept.std() / np.sqrt(len(kept))
    numbers = np.array([number for number, _ in profile._kept])
    assert abs(numbers.mean() / count - 0.5) < 4.0 * np.sqrt(1.0 / 12.0 / MOST_FRAMES)


def test_spans_of_the_device_are_told_by_the_clock_of_the_host(clock: HostClock) -> None:
    """The device's clock is 1000 ms ahead; enqueuing took the host some time, once very little."""
    profile = Profile()
    profile.trace()
    for enqueued, delay in ((10, 3), (20, 0), (30, 5)):
        queued = 1000 + enqueued - delay
        event = FakeEvent((queued + 1) * MS, (queued + 4) * MS, queued * MS)
        clock.ns = enqueued * MS
        profile.record(event, "trace", Kind.KERNEL, 8)
    clock.ns = 40 * MS
    with profile.host("draw"):
        clock.wait(5.0)
    profile.end_frame()
    spans = [(s.key.name, s.start_ns // MS, s.end_ns // MS) for s in profile.spans()]
    assert spans == [("trace", 8, 11), ("trace", 21, 24), ("trace", 26, 29), ("draw", 40, 45)]
    profile.reset()
    assert profile.spans() == []


def test_without_a_trace_no_span_is_kept() -> None:
    profile = Profile()
    frame(profile, {"march": 1.0})
    assert profile.spans() == []


def test_a_device_tells_transfers_from_kernels_and_counts_bytes(device: ComputeDevice) -> None:
    device.finish()
    device.profile.reset()
    kernel = device.kernel("world/real/pyramid.cl", "reduce_range")
    with device.profile.section("some pass"):
        ranges = device.upload("ranges", np.ones((4 * 2 + 2 * 1, 2), np.float32))
        kernel((2, 1), columns=4, rows=2, fine=0, coarse=8, first=0, count=1, range=ranges)
        device.fill_zero(ranges)
        device.read(ranges)
    device.profile.end_frame()
    (costs,) = device.profile.kept_frames()
    assert all(cost.launches == 1 and cost.ms > 0.0 for cost in costs.values())
    assert {key: cost.bytes for key, cost in costs.items()} == {
        Key("some pass", "write", Kind.TRANSFER): 80,
        Key("some pass", "reduce_range", Kind.KERNEL): 80,
        Key("some pass", "fill", Kind.TRANSFER): 80,
        Key("some pass", "read", Kind.TRANSFER): 80,
        Key("some pass", "some pass", Kind.ENQUEUE): 0,
    }


def test_frames_that_follow_too_soon_are_not_recorded(clock: HostClock) -> None:
    """And do not count, so that means over frames stay true."""
    profile = Profile()
    profile.every_s = 0.05
    recorded = []
    for number in range(12):
        clock.ns = 20 * MS * number
        recorded.append(profile.recording)
        with profile.section("march"):
            launch(profile, "march", "march", 2.0)
            assert profile.current == "march"
        clock.wait(19.9)
        profile.end_frame()
    # Each begins 0.05 s or more after the one before.
    assert [number for number, now in enumerate(recorded) if now] == [0, 3, 6, 9]
    assert profile.frames == 4
    assert profile.passes()[0].device_ms == 4 * 2.0
