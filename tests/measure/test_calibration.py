"""Calibration: entries take turns, time is kept to, and lines go through what was measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from iprt.geometry.camera import View
from iprt.measure import calibration
from iprt.measure.calibration import SIDES, TIMES_S, TimedView, Times, measure_times, tradeoff_of
from iprt.measure.intervals import Ratio
from iprt.measure.tradeoff_cache import TimedDevice
from iprt.settings.ladder import BALANCED, LADDER
from tests.measure.tables import FRAMES, made_table

TIMED = TimedDevice("a device (a platform)", "1.0")
SSIM = {entry.name: entry.ssim for entry in made_table().entries}
Given = Mapping[str, tuple[float, float]]


def times(pixels: int, lines: Given) -> Times:
    """Of entries whose frames take fixed + slope · pixels."""
    seconds = {name: fixed + slope * pixels for name, (fixed, slope) in lines.items()}
    base = seconds[BALANCED]
    ratios = {
        name: Ratio(each / base, 0.9 * each / base, 1.2 * each / base)
        for name, each in seconds.items()
    }
    return Times(pixels, base, ratios)


def test_lines_and_ratios_are_those_of_the_largest_pictures() -> None:
    lines = {name: (0.01 * (i + 1), 1e-7 * (i + 2) ** 2) for i, name in enumerate(LADDER)}
    slower = {name: (2.0 * fixed, 2.0 * slope) for name, (fixed, slope) in lines.items()}
    small = times(10_000, dict.fromkeys(LADDER, (9.0, 0.0)))
    table = tradeoff_of(
        TIMED,
        "mine",
        {
            "a": [small, times(50_000, lines), times(200_000, lines)],
            "b": [times(50_000, slower), times(200_000, slower)],
        },
        "room",
        SSIM,
        FRAMES,
    )
    assert (table.scene, table.truth, table.device) == ("mine", "room", TIMED.device)
    assert TIMED.made(table)
    base = lines[BALANCED][0] + lines[BALANCED][1] * 200_000
    for entry in table.entries:
        fixed, slope = lines[entry.name]
        assert entry.seconds["a"] == pytest.approx([fixed, slope], rel=1e-3)
        assert entry.seconds["b"] == pytest.approx([2.0 * fixed, 2.0 * slope], rel=1e-3)
        share = (fixed + slope * 200_000) / base
        assert entry.ratio == pytest.approx([share, 0.9 * share, 1.2 * share], abs=6e-4)
        assert entry.ssim == SSIM[entry.name]


@pytest.mark.parametrize(
    ("few_s", "many_s", "line"),
    [(0.1, 0.5, [0.0, 5e-6]), (0.2, 0.1, [0.1, 0.0]), (0.05, 0.1, [0.0333, 6.667e-7])],
)
def test_noise_makes_no_negative_times(few_s: float, many_s: float, line: list[float]) -> None:
    both = [
        times(n, dict.fromkeys(LADDER, (s, 0.0))) for n, s in ((25_000, few_s), (100_000, many_s))
    ]
    table = tradeoff_of(TIMED, "a", {"a": both}, "room", SSIM, FRAMES)
    assert table.entries[0].seconds["a"] == pytest.approx(line, rel=1e-3)


class Simulated:
    """A device on which a round of all entries takes `round_s` at 384x384, and warm-ups as long."""

    memory = 2**34

    def __init__(self, monkeypatch: pytest.MonkeyPatch, round_s: float, compile_s: float) -> None:
        self.now_s, self.round_s, self.compile_s = 0.0, round_s, compile_s
        self.blocks: list[tuple[int, int]] = []
        monkeypatch.setattr(calibration, "_timed", self.timed)

    def timed(self, device: Any, reels: Mapping[str, Any], enough: Callable[[int], bool]) -> Times:
        assert device is self
        view = reels[BALANCED].view
        pixels = view.width * view.height
        self.now_s += 0.0 if self.blocks else self.compile_s
        done = 0
        while not enough(max(done - 16, 0)) or done < 12:
            self.now_s += self.round_s * pixels / 384**2
            done += 1
        self.blocks.append((pixels, done))
        return times(pixels, dict.fromkeys(LADDER, (0.1, 1e-06)))

    def measure(self, bytes_of: Callable[[int], int] = lambda side: 0) -> dict[str, list[Times]]:
        class Sized(TimedView):
            def bytes(self, side: int) -> int:
                return bytes_of(side)

        frame: Any = SimpleNamespace()
        views = [Sized(name, frame, (), View(300, 200)) for name in ("a", "b")]
        return measure_times(
            self,  # type: ignore[arg-type]
            views,
            progress=lambda seconds: None,
            clock=lambda: self.now_s,
        )


@pytest.mark.parametrize("round_s", [0.001, 0.02, 0.1, 0.4, 0.9])
@pytest.mark.parametrize("compile_s", [0.0, 15.0])
def test_it_takes_the_time_that_it_may(
    round_s: float, compile_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = Simulated(monkeypatch, round_s, compile_s)
    found = device.measure()
    assert device.now_s < 1.2 * TIMES_S
    assert found.keys() == {"a", "b"}
    assert len(found["a"]) == len(found["b"]) >= 2
    for one in found.values():
        sizes = [measured.pixels for measured in one]
        assert sizes == pytest.approx([side**2 for side in SIDES[: len(sizes)]], rel=0.02)
    assert all(12 <= done <= 56 for _, done in device.blocks)
    if round_s < 0.01:
        assert len(found["a"]) == len(SIDES)
        assert {done for _, done in device.blocks} == {56}


def test_a_device_too_slow_is_timed_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    device = Simulated(monkeypatch, 60.0, 0.0)
    assert [len(of_view) for of_view in device.measure().values()] == [2, 2]
    assert {done for _, done in device.blocks} == {12}


def test_renderers_leave_half_of_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    device = Simulated(monkeypatch, 0.001, 0.0)
    found = device.measure(lambda side: device.memory if side > 768 else device.memory // 4)
    assert len(found["a"]) == 3
