"""Rows, tables and files of a profile: medians of frames, shares, bandwidth and work."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from iprt.device.counting import Rays, Work
from iprt.device.profile import Kind, Profile
from iprt.geometry.camera import View
from iprt.measure.changes import Change
from iprt.measure.cost import BLOCKS, FEWEST_FRAMES, RayRow, Timing, WorkRow, pass_rows
from iprt.measure.cost_report import CostReport, read_report, write_report
from iprt.measure.cost_tables import change_grid, compile_grid, memory_grid, part_grid, pass_grid
from iprt.measure.results import json_text
from iprt.output.grid import Grid
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
    real, objects = RayRow(20.0, 10.0, 25), RayRow(5.0, 3.0, 5)
    assert trace.work == WorkRow(50.0, 15.0, 2.0, 1.0, real, objects)
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


# Tables and files --------------------------------------------------------------------------------


def made() -> CostReport:
    """24 ms on the device and 8 on the host per frame, over four frames."""
    profile = Profile()
    profile.compiled = {"march.cl -DX=1": 400.0, "march.cl": 600.0, "blend.cl": 234.0}
    for _ in range(4):
        launch(profile, "march", "trace", 20.0, 5_000_000)
        launch(profile, "march", "write", 4.0, 2_000_000, Kind.TRANSFER)
        launch(profile, "blend", "mix", 8.0, 16_000_000)
        profile.end_frame()
    profile.first_launches = {"march.cl": 66.0, "blend.cl": 100.0}
    report = report_of(profile, (40.0,) * 4)
    return replace(
        report.with_work(profile, {("march", "trace"): WorkRow.of(WORK, 1)}), traced=0.25
    )


def cells(grid: Grid) -> dict[str, dict[str, str]]:
    """The texts by row and column."""
    return {row[0]: dict(zip(grid.columns, row, strict=True)) for row in grid.rows}


def test_passes_come_with_their_sum_and_what_is_done_once() -> None:
    grid = pass_grid(made())
    rows = cells(grid)
    assert list(rows) == ["all passes", "march", "blend"]
    assert (rows["march"]["ms"], rows["march"]["share"]) == ("24.00", "75.0%")
    assert rows["all passes"]["ms"] == "32.00"
    assert (rows["all passes"]["share"], rows["all passes"]["launches"]) == ("100.0%", "3")
    told = "\n".join([grid.title, *grid.notes])
    for part in ("40x30", "4 frames on a device", "40.00 ms/frame", "25.0 frames/s", "25.0% of"):
        assert part in told
    assert "compiling kernels 1400 ms, preparing the panorama 7 ms" in told


def test_parts_tell_bytes_bandwidth_and_work() -> None:
    rows = cells(part_grid(made()))
    assert list(rows) == ["all passes", "march", "  trace", "  write", "blend", "  mix"]
    trace = rows["  trace"]
    assert (trace["MB"], trace["GB/s"]) == ("5.00", "")
    assert (trace["rays"], trace["steps"], trace["most"]) == ("40", "10.0", "25")
    assert [trace[f"object {name}"] for name in ("rays", "steps", "most")] == ["10", "3.0", "5"]
    assert (trace["active"], trace["groups"]) == ("30/100", "2/4")
    assert rows["  mix"]["GB/s"] == "2.00"
    assert rows["  write"]["GB/s"] == "0.50"
    assert rows["  mix"]["rays"] == ""


def test_buffers_and_programs_that_are_small_come_together() -> None:
    buffers = {"tiny": 1, "large": 3 * 2**20, "small": 2, "medium": 2**20}
    grid = memory_grid(replace(made(), buffers=buffers, memory=2**30))
    assert [row[0] for row in grid.rows] == ["large", "medium", "2 others"]
    assert cells(grid)["large"] == {"buffer": "large", "MiB": "3.00", "share": "75.0%"}
    assert grid.notes == ("4 MiB of the device's 1.0 GiB",)
    grid = memory_grid(replace(made(), buffers=buffers | {"OpenGL layers": 2**21}, memory=2**30))
    assert cells(grid)["OpenGL layers"]["MiB"] == "2.00"
    assert grid.notes == ("4 MiB of the device's 1.0 GiB, and 2 MiB of OpenGL's",)
    grid = compile_grid(made())
    assert [row[:3] for row in grid.rows] == [
        ("march.cl", "1000", "66"),
        ("blend.cl", "234", "100"),
    ]
    assert cells(grid)["march.cl"]["share"] == "76.1%"
    assert grid.notes[0] == "1400 ms, once"
    few = replace(made(), compiled={"a.cl": 5.0, "b.cl": 900.0}, first_launches={"a.cl": 2.0})
    assert compile_grid(few).rows[-1][:3] == ("1 others", "5", "2")


def test_changes_beyond_the_noise_are_marked() -> None:
    changes = [
        Change("march", "", 10.0, 12.0, 0.5),
        Change("march", "trace", 10.0, 10.1, 0.5),
        Change("new", "", None, 3.0, None),
    ]
    grid = change_grid(changes, ["trace.rays = 4, was 2"], "old.json")
    assert grid.rows == (
        ("march", "10.000", "12.000", "+2.000", "+20.0", "±0.500", "*"),
        ("  trace", "10.000", "10.100", "+0.100", "+1.0", "±0.500", ""),
        ("new", "", "3.000", "+3.000", "", "", "*"),
    )
    assert grid.notes[-1] == "trace.rays = 4, was 2"


def test_a_report_survives_its_file(tmp_path: Path) -> None:
    file = tmp_path / "new" / "profile.json"
    for report in (made(), replace(made(), wall=None, traced=None)):
        write_report(file, report)
        assert read_report(file) == report
        assert json.loads(json_text(report)) == json.loads(file.read_text())


def test_json_takes_any_name_and_no_infinity() -> None:
    text = json_text({"name": "\udcff", "psnr": float("inf")})
    assert json.loads(text) == {"name": "\udcff", "psnr": None}
