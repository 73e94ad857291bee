"""Pace, on simulated devices: it holds the target, settles, and goes back to what was asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from iprt.settings.overrides import changed, plain_values, resolved
from iprt.settings.presets import Quality
from iprt.viewer.engine import Engine
from iprt.viewer.ladder import (
    SCALE,
    Ladder,
    MeasuredRung,
    MeasuredSetting,
    measured_ladder,
    order_of_notches,
    rungs_below,
)
from iprt.viewer.pace import Pace
from iprt.viewer.state import Request
from tests.clips import write_clip
from tests.viewer.turns import SETTINGS, VIEW
from tests.waiting import DEADLINE_S

SHARES = (0.8, 0.62, 0.45, 0.3, 0.2, 0.12)
RAYS = (32, 16, 8, 4, 2, 1)
BASE = changed(Settings(), {"trace.object_rays": 64})


def ladder(shares: Sequence[float] = SHARES) -> Ladder:
    rungs = [
        MeasuredRung(
            changes={"trace.object_rays": rays},
            ms_share=share,
            ssim_cost=round(0.01 * (1 - share), 4),
        )
        for rays, share in zip(RAYS, shares, strict=True)
    ]
    return Ladder(
        device="simulated",
        date="2000-01-01",
        scene="none",
        views=("one",),
        size=(16, 16),
        quality="balanced",
        ms=1.0,
        ssim=1.0,
        compiling={},
        settings=(),
        rungs=tuple(rungs),
    )


class Simulated:
    """A device that takes its own time for each rung, with noise, and longer after a change.

    `shares` are those of all rungs, the first included; `load` is seconds on rung 0, by frame.
    """

    def __init__(
        self,
        pace: Pace,
        load: Callable[[int], float],
        *,
        shares: Sequence[float] = (1.0, *SHARES),
        noise: float = 0.1,
        seed: int = 0,
    ) -> None:
        self.pace, self.load, self.shares, self.noise = pace, load, shares, noise
        self.random = np.random.default_rng(seed)
        self.seconds: list[float] = []
        self.numbers: list[int] = []  # of the rung that each frame was rendered on

    def play(self, frames: int) -> None:
        for _ in range(frames):
            number, index = self.pace.rung.number, len(self.seconds)
            stood = 0
            while stood < 8 and stood < index and self.numbers[-1 - stood] == number:
                stood += 1
            wait = 1.0 + 3.0 * (self.random.random() < 0.02 * (self.noise > 0.0))
            time = self.load(index) * self.shares[number] * (1.0 + 0.2 * 0.5**stood) * wait
            time *= float(np.exp(self.noise * self.random.standard_normal()))
            self.numbers.append(number)
            self.seconds.append(time)
            self.pace.observe(time, compiled=False)

    @property
    def changes(self) -> list[tuple[int, int, int]]:
        """Frame, and the rungs before and after."""
        pairs = enumerate(pairwise(self.numbers), 1)
        return [(i, a, b) for i, (a, b) in pairs if a != b]

    def require_no_hunting(self, least_s: float = 1.0) -> None:
        """It was never on a rung for less than `least_s` between leaving it and coming back."""
        clock = np.cumsum(self.seconds)
        for (i, a, b), (j, c, d) in pairwise(self.changes):
            if (a > b) != (c > d):
                assert clock[j - 1] - clock[i - 1] >= least_s, (i, a, b, j, c, d)


@pytest.mark.parametrize(("load", "rung"), [(0.02, 0), (0.0395, 2), (0.07, 4)])
def test_it_finds_the_best_rung_that_holds_the_target_at_once(load: float, rung: int) -> None:
    device = Simulated(Pace(30.0, BASE, ladder()), lambda _: load, noise=0.0)
    device.play(1000)
    assert set(device.numbers[7:]) == {rung}


@pytest.mark.parametrize(("load", "rung"), [(0.02, 0), (0.0395, 2), (0.07, 4), (9.0, 6)])
def test_what_is_known_of_the_first_rung_saves_the_search(load: float, rung: int) -> None:
    pace = Pace(30.0, BASE, ladder(), usual_s=load)
    assert pace.rung.number == rung
    device = Simulated(pace, lambda _: load, noise=0.0)
    device.play(300)
    assert set(device.numbers) == {rung}


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("load", [0.02, 0.0395, 0.07, 0.1, 0.2])
@pytest.mark.parametrize("noise", [0.1, 0.2])
def test_noise_does_not_keep_it_from_settling(load: float, noise: float, seed: int) -> None:
    device = Simulated(Pace(30.0, BASE, ladder()), lambda _: load, noise=noise, seed=seed)
    device.play(2000)
    assert len(device.changes) <= 4
    assert sum(frame >= 1000 for frame, _, _ in device.changes) <= 1
    number = device.numbers[-1]
    assert np.mean(device.seconds[-1000:]) < 1.15 / 30.0
    # The one above would take too long, or so nearly that it is not worth the change.
    assert not number or load * device.shares[number - 1] > 0.7 / 30.0


@pytest.mark.parametrize("seed", range(4))
def test_a_step_of_the_load_is_followed_in_a_few_frames_and_taken_back(seed: int) -> None:
    fps, before, during = 30.0, 0.022, 0.07
    step, end = 300, 1000
    device = Simulated(
        Pace(fps, BASE, ladder()), lambda i: during if step <= i < end else before, seed=seed
    )
    device.play(2000)
    assert set(device.numbers[20:step]) == {0}
    assert len(set(device.numbers[step + 25 : end])) == 1
    assert np.mean(device.seconds[step + 25 : end]) < 1.1 / fps
    # Up again after two seconds, at most, and a window.
    until = end + int(2.0 / (before * 0.3)) + 20
    assert set(device.numbers[until:]) == {0}
    assert len(device.changes) <= 6
    device.require_no_hunting()


def test_a_rung_that_disappoints_is_not_tried_again_and_again() -> None:
    """A device on which most of the ladder saves nothing, but for its lowest rung."""
    device = Simulated(
        Pace(30.0, BASE, ladder()), lambda _: 0.05, shares=(1.0, 1.0, 1.0, 0.98, 0.95, 0.9, 0.3)
    )
    device.play(5000)
    assert np.mean(np.array(device.numbers[200:]) == 6) > 0.95
    # It is tried once more in a minute and a half: then its time may have come.
    assert len(device.changes) <= 7


def test_a_load_that_ends_as_the_rung_changes_is_not_held_against_the_better_ones() -> None:
    pace = Pace(30.0, BASE, ladder())
    device = Simulated(pace, lambda _: 0.1 if not pace.rung.number else 0.02, noise=0.05)
    device.play(20)
    assert pace.rung.number > 0
    device.load = lambda _: 0.02
    device.play(6000)
    assert sum(device.seconds[: device.numbers.index(0, 20)]) < 40.0
    assert set(device.numbers[-1000:]) == {0}


def test_nothing_holds_the_target() -> None:
    device = Simulated(Pace(240.0, BASE, ladder()), lambda _: 1.0)
    device.play(200)
    assert set(device.numbers[30:]) == {len(SHARES)}


@settings(max_examples=40)
@given(
    true=st.lists(st.floats(0.3, 1.05), min_size=6, max_size=6),
    loads=st.lists(st.floats(0.002, 0.4), min_size=1, max_size=4),
    noise=st.floats(0.0, 0.2),
    seed=st.integers(0, 1000),
)
def test_whatever_the_device_it_does_not_hunt(
    true: list[float], loads: list[float], noise: float, seed: int
) -> None:
    """Each true share is that of the rung above times an arbitrary factor."""
    shares = np.cumprod([1.0, *true])
    length = 1200
    device = Simulated(
        Pace(30.0, BASE, ladder()),
        lambda i: loads[min(i // length, len(loads) - 1)],
        shares=list(shares),
        noise=noise,
        seed=seed,
    )
    device.play(length * len(loads))
    device.require_no_hunting()
    assert len(device.changes) <= 8 * len(loads)
    tail = device.numbers[-length // 4 :]
    # By then it has tried what there is to try, but for a last look at a rung or two.
    assert sum(a != b for a, b in pairwise(tail)) <= 3
    if min(shares) * loads[-1] < 0.7 / 30.0:
        assert np.median(device.seconds[-length // 4 :]) < 1.15 / 30.0


def test_frames_that_compile_do_not_count() -> None:
    plain, disturbed = (Pace(30.0, BASE, ladder()) for _ in range(2))
    random = np.random.default_rng(1)
    shares = (1.0, *SHARES)
    for index in range(600):
        time = 0.06 * shares[plain.rung.number] * float(random.uniform(0.9, 1.1))
        if index % 3 == 0:
            assert disturbed.observe(5.0, compiled=True) is disturbed.rung
        assert plain.observe(time, compiled=False) == disturbed.observe(time, compiled=False)
    assert plain.rung.number > 0


@pytest.mark.parametrize("quality", get_args(Quality))
def test_rungs_start_from_what_was_asked_for_and_never_exceed_it(quality: Quality) -> None:
    base = changed(resolved(quality), {"seed": 7, "trace.object_rays": 3})
    rungs = rungs_below(base, measured_ladder())
    assert (rungs[0].settings, rungs[0].scale, rungs[0].preview) == (base, 1.0, None)
    own = plain_values(base)
    assert [rung.number for rung in rungs] == list(range(len(rungs)))
    for above, below in pairwise(rungs):
        assert below.share < above.share
        assert below.scale <= above.scale
        assert (below.settings, below.scale) != (above.settings, above.scale)
        now = plain_values(below.settings)
        assert all(now[k] <= own[k] for k in own if now[k] != own[k])
        assert below.preview is not None
        lines = below.preview.details.splitlines()
        told = {line.split()[0]: line for line in lines if " instead of " in line}
        assert set(told) == {key for key in own if now[key] != own[key]}
        for key, line in told.items():
            if not isinstance(own[key], bool):
                assert line.startswith(f"{key} {now[key]:g} instead of {own[key]:g}")
        smaller = f"Preview at {100 * below.scale:.0f}% resolution"
        assert (below.preview.short == smaller) == (below.scale < 1.0)
        assert "-0.000" not in below.preview.details


def test_what_was_not_there_is_not_given_up() -> None:
    """A rung has two settings: if the user has turned down one already, the other is left."""
    settings = tuple(
        MeasuredSetting(key=key, value=1, ms_share=0.5, ssim_cost=cost)
        for key, cost in (("trace.rays", 0.1), ("trace.object_rays", 0.2))
    )
    both = MeasuredRung(
        changes={"trace.rays": 1, "trace.object_rays": 1}, ms_share=0.25, ssim_cost=0.3
    )
    measured = ladder().model_copy(update={"settings": settings, "rungs": (both,)})
    for rays, share, cost in ((2, 0.25, 0.3), (1, 0.5, 0.2)):
        base = changed(BASE, {"trace.rays": rays})
        _, rung = rungs_below(base, measured)
        assert (rung.share, rung.ssim_cost) == pytest.approx((share, cost))
        assert rung.preview is not None
        lines = rung.preview.details.splitlines()
        assert ("trace.rays 1 instead of 2 (SSIM -0.100)" in lines) == (rays == 2)
        assert "trace.object_rays 1 instead of 64 (SSIM -0.200)" in lines
        assert rung.preview.short == "Preview at reduced quality"


def test_the_ladder_of_the_package_gives_up_more_and_more() -> None:
    found = measured_ladder()
    before = MeasuredRung(changes={}, ms_share=1.0, ssim_cost=-1.0)
    for rung in found.rungs:
        assert rung.ms_share < before.ms_share
        assert rung.ssim_cost > before.ssim_cost
        assert before.changes.items() != rung.changes.items()
        assert not rung.changes.keys() & found.compiling.keys()
        settings_there = changed(Settings(), {k: v for k, v in rung.changes.items() if k != SCALE})
        assert isinstance(settings_there, Settings)
        before = rung
    assert found.rungs[-1].changes[SCALE] <= 0.5
    assert {setting.key for setting in found.settings} >= found.rungs[-1].changes.keys()


def test_what_saves_most_for_its_error_is_given_up_first() -> None:
    def setting(key: str, value: int, share: float, cost: float) -> MeasuredSetting:
        return MeasuredSetting(key=key, value=value, ms_share=share, ssim_cost=cost)

    notches = {
        "dear": [setting("dear", 1, 0.9, 0.1)],
        "cheap": [setting("cheap", 2, 0.5, 0.01), setting("cheap", 1, 0.4, 0.5)],
        "free": [setting("free", 1, 0.99, -0.01)],
        "useless": [setting("useless", 1, 1.01, 0.0)],
    }
    order = [(notch.key, notch.value) for notch in order_of_notches(notches)]
    assert order == [("free", 1), ("cheap", 2), ("dear", 1), ("cheap", 1), ("useless", 1)]


def test_an_engine_follows_down_and_up_again(tmp_path: Path, device: ComputeDevice) -> None:
    """Settings and resolution, on times as a slow and then a quick device would take them."""
    small = MeasuredRung(
        changes={"trace.object_rays": 1, "atrous.levels": 1, SCALE: 0.5},
        ms_share=0.2,
        ssim_cost=0.1,
    )
    base = changed(SETTINGS, {"trace.object_rays": 2})
    pace = Pace(5.0, base, ladder().model_copy(update={"rungs": (small,)}))
    scene = Scene.open(write_clip(tmp_path / "clip", 2))
    seen = []
    with Engine(scene, lambda: device, base) as engine:
        client = engine.client(Request(VIEW))
        for frame in range(150):
            seconds = 0.8 if frame < 30 else 0.15
            rung = pace.rung
            width, height = (round(rung.scale * n) for n in (VIEW.width, VIEW.height))
            wanted = VIEW.resized(width, height)
            view = replace(wanted, yaw_deg=0.01 * frame)
            number = client.ask(Request(view, settings=rung.settings))
            shown = client.wait(number, DEADLINE_S)
            assert shown is not None, engine.status
            assert shown.picture.color.shape == (height, width, 3)
            assert shown.request.settings is rung.settings
            seen.append((rung.number, shown.picture.color.mean()))
            pace.observe(seconds * rung.share, shown.compiled)
        assert not engine.status.problems
    assert [number for number, _ in groupby(number for number, _ in seen)] == [0, 1, 0]
    assert pace.rung.settings is base
    # The light of the picture is the same, however little of it is rendered.
    means = [np.mean([mean for number, mean in seen if number == rung]) for rung in (0, 1)]
    assert means[1] == pytest.approx(means[0], rel=0.05)
