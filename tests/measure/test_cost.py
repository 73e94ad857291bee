"""Rows of a profile: medians of frames, shares, bandwidth, and what is done with them."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from iprt.device.counting import Rays, Work
from iprt.device.profile import Kind, Profile
from iprt.geometry.camera import View
from iprt.measure.cost import BLOCKS, FEWEST_FRAMES, Timing, WorkRow, pass_rows
from iprt.measure.cost_report import CostReport
from iprt.measure.profile_file import csv_text, json_text
from iprt.settings.model import Settings
from tests.profiles import frame, launch

WORK = Work(100, 30, 4, 2, Rays(40, 400, 25), Rays(10, 30, 5))


def device_with(profile: Profile) -> Any:
    return SimpleNamespace(
        profile=profile, name="a device", buffers={"x": 60}, opengl={}, memory=600
    )


def report_of(profile: Profile, walls: tuple[float, ...] = ()) -> CostReport:
    """As `iprt profile` would make it."""
    return CostReport.of(
        device_with(profile),
        scene="room",
        view=View(40, 30),
        settings=Settings(),
        prepare_ms=7.0,
        walls=walls,
    )


def test_medians_of_passes_are_those_of_sums_of_parts() -> None:
    """In three frames two kernels take turns at being slow; their sum never changes."""
    profile = Profile()
    for one, two in ((1.0, 5.0), (5.0, 1.0), (1.0, 5.0)):
        launch(profile, "march", "one", one)
        launch(profile, "march", "two", two)
        launch(profile, "blend", "mix", 2.0)
        profile.end_frame()
    march, blend = pass_rows(profile.kept_frames())
    assert [part.timing.ms for part in march.parts] == [1.0, 5.0]
    assert march.timing == Timing(6.0, 6.0, 6.0, None)
    assert (march.share, blend.share) == (0.75, 0.25)
    assert sum(part.share for part in march.parts) == pytest.approx(march.share)
    assert sum(part.timing.mean_ms for part in march.parts) == pytest.approx(march.timing.mean_ms)


def test_a_pass_that_most_frames_lack_has_a_median_of_zero() -> None:
    profile = Profile()
    for index in range(4):
        frame(profile, {"march": 4.0, **({"panorama": 8.0} if index == 2 else {})})
    march, panorama = pass_rows(profile.kept_frames())
    assert (march.timing.ms, march.launches) == (4.0, 1.0)
    assert (panorama.timing.ms, panorama.timing.mean_ms, panorama.launches) == (0.0, 2.0, 0.25)
    assert panorama.share == pytest.approx(2.0 / 6.0)
    assert panorama.timing.p95_ms == pytest.approx(np.percentile([0.0, 0.0, 8.0, 0.0], 95))


def test_bandwidth_is_bytes_by_time_where_buffers_are_streamed() -> None:
    profile = Profile()
    for blur in (1.0, 1.0, 4.0):
        launch(profile, "march", "trace", 2.0, 4_000_000)
        launch(profile, "march", "write", 0.5, 1_000_000, Kind.TRANSFER)
        launch(profile, "march", "blur", blur, 3_000_000)
        launch(profile, "march", "blur", blur, 3_000_000)
        with profile.host("draw"):
            pass
        profile.end_frame()
    counted = {("march", "trace"): WorkRow.of(WORK, 2)}
    march, draw = pass_rows(profile.kept_frames(), counted)
    trace, write, blur = march.parts
    assert (trace.gb_per_s, write.gb_per_s, blur.gb_per_s) == (None, 2.0, 1.5)
    assert (trace.bytes, blur.bytes, blur.launches) == (4e6, 6e6, 2.0)
    assert draw.parts[0].gb_per_s is None
    assert draw.parts[0].kind is Kind.HOST
    assert trace.work == WorkRow(50.0, 15.0, 2.0, 1.0, 20.0, 10.0, 25, 5.0, 3.0, 5)
    assert blur.work is None


def test_the_error_of_a_median_is_that_of_repeated_runs() -> None:
    """Independent frames: as the medians of many runs scatter, within the error of that."""
    rng = np.random.default_rng(2)
    runs = 10.0 + rng.normal(size=(400, 96))
    timings = [Timing.of(list(run)) for run in runs]
    told = np.sqrt(np.mean([timing.error_ms**2 for timing in timings if timing.error_ms]))
    scatter = np.std([timing.ms for timing in timings])
    assert told == pytest.approx(scatter, rel=0.15)


def test_noise_that_lasts_for_some_frames_counts_in_full() -> None:
    """Runs of frames are slower or faster as a whole: as sure as of one frame from each."""
    rng = np.random.default_rng(2)
    runs = 10.0 + rng.normal(size=(200, BLOCKS))
    timings = [Timing.of(list(np.repeat(run, 12))) for run in runs]
    told = np.sqrt(np.mean([timing.error_ms**2 for timing in timings if timing.error_ms]))
    scatter = np.std([timing.ms for timing in timings])
    assert told == pytest.approx(scatter, rel=0.25)


def test_a_busy_moment_makes_a_median_no_less_sure() -> None:
    frames = 10.0 + 0.1 * np.random.default_rng(2).normal(size=96)
    calm, busy = Timing.of(list(frames)), Timing.of([*frames[:84], *(10.0 * frames[84:])])
    assert calm.error_ms is not None
    assert busy.error_ms is not None
    assert busy.error_ms < 3.0 * calm.error_ms
    assert Timing.of([1.0] * (FEWEST_FRAMES - 1)).error_ms is None
    assert Timing.of([1.0] * FEWEST_FRAMES).error_ms == 0.0


def test_plain_data_hold_the_same_in_json_and_csv() -> None:
    profile = Profile()
    frame(profile, {"march": 6.0, "blend": 2.0})
    report = report_of(profile, (10.0,)).with_work(
        profile, {("march", "march"): WorkRow.of(WORK, 1)}
    )
    record = json.loads(json_text(report))
    assert (record["schema"], record["scene"], record["device"]) == (1, "room", "a device")
    assert (record["width"], record["height"], record["frames"]) == (40, 30, 1)
    assert (record["wall_ms"], record["ms"], record["prepare_ms"]) == (10.0, 8.0, 7.0)
    assert (record["memory"], record["buffers"]) == (600, {"x": 60})
    march, blend = record["passes"]
    assert (march["name"], march["ms"], march["share"]) == ("march", 6.0, 0.75)
    assert march["parts"][0]["work"]["most_steps"] == 25
    assert blend["parts"][0]["work"] is None

    rows = list(csv.DictReader(io.StringIO(csv_text(report))))
    assert [(row["pass"], row["part"], row["kind"]) for row in rows] == [
        ("march", "", "pass"),
        ("march", "march", "kernel"),
        ("blend", "", "pass"),
        ("blend", "blend", "kernel"),
    ]
    assert [float(row["ms"]) for row in rows] == [6.0, 6.0, 2.0, 2.0]
    assert [row["rays"] for row in rows] == ["", "40.0", "", ""]
    assert json.loads(json_text(replace(report, wall=None)))["wall_ms"] is None
