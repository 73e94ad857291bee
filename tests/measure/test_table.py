"""The tables of a profile, as people read them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from iprt.device.profile import Kind, Profile
from iprt.measure.changes import Change
from iprt.measure.cost import WorkRow
from iprt.measure.cost_report import CostReport
from iprt.measure.profile_file import write_profile
from iprt.measure.table import change_grid, compile_grid, memory_grid, part_grid, pass_grid
from iprt.output.grid import Grid
from tests.measure.test_cost import WORK, report_of
from tests.profiles import launch


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
    """By row and column; the second column of a name counts as `name 2`."""
    names = [f"{n} 2" if n in grid.columns[:i] else n for i, n in enumerate(grid.columns)]
    return {row[0]: dict(zip(names, row, strict=True)) for row in grid.rows}


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
    assert (trace["object rays"], trace["steps 2"], trace["most 2"]) == ("10", "3.0", "5")
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
        ("march", "10.000", "12.000", "+2.000", "+20.0%", "±0.500", "*"),
        ("  trace", "10.000", "10.100", "+0.100", "+1.0%", "±0.500", ""),
        ("new", "", "3.000", "+3.000", "", "", "*"),
    )
    assert grid.notes[-1] == "trace.rays = 4, was 2"


def test_a_profile_file_holds_the_report(tmp_path: Path) -> None:
    file = tmp_path / "new" / "profile.json"
    report = made()
    write_profile(file, report)
    record = json.loads(file.read_text())
    assert record == json.loads(json.dumps(report.record()))
    assert sum(row["ms"] for row in record["passes"]) == record["ms"] == 32.0
