"""`iprt profile`, from the command line to its output, on scenes of a few pixels."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from iprt import cli
from iprt.device.compute import ComputeDevice
from iprt.device.profile import Kind, Profile
from iprt.measure.cost_report import write_report
from tests.clips import write_clip
from tests.measure.test_cost import report_of
from tests.output.test_timeline import check_trace
from tests.profiles import frame
from tests.scene.files import MANIFEST, OBJECT, VIEW, write_scene

SIZE = ("--size", "18", "12")
QUICK = ("--set", "irradiance.rows=16", "--set", "iprt.ratio_rows=16")


@pytest.fixture
def room(tmp_path: Path) -> Path:
    return write_scene(tmp_path / "room", MANIFEST + OBJECT + VIEW)


@pytest.fixture
def printed(capsys: pytest.CaptureFixture[str], device: ComputeDevice) -> Callable[..., str]:
    """What the verb prints."""

    def run(scene: Path, *words: object) -> str:
        on = ("--device", device.device.platform.name)
        given = ["profile", scene, *SIZE, *QUICK, *on, *words]
        assert cli.main([str(word) for word in given]) == 0
        return capsys.readouterr().out

    return run


@pytest.mark.thorough
@pytest.mark.gl
def test_a_still_scene_is_profiled_and_compared(
    room: Path, tmp_path: Path, printed: Callable[..., str]
) -> None:
    trace, old = tmp_path / "trace.json", tmp_path / "old.json"
    old.write_text(printed(room, "--repeat", 16, "--trace", trace, "--json"))
    record: dict[str, Any] = json.loads(old.read_text())
    assert (record["frames"], record["view"]["width"], record["view"]["height"]) == (16, 18, 12)
    passes = {row["name"]: row for row in record["passes"]}
    assert sum(row["share"] for row in record["passes"]) == pytest.approx(1.0)
    for row in record["passes"]:
        parts = sum(part["timing"]["mean_ms"] for part in row["parts"])
        assert parts == pytest.approx(row["timing"]["mean_ms"])
    total = sum(row["timing"]["mean_ms"] for row in record["passes"])
    assert record["frame"]["mean_ms"] == pytest.approx(total)
    (delta,) = passes["trace real"]["parts"]
    assert (delta["name"], delta["kind"], delta["launches"]) == ("trace_delta", Kind.KERNEL, 1.0)
    assert 0.0 < delta["work"]["active"] <= delta["work"]["items"] == 18 * 12
    assert delta["work"]["objects"]["steps"] >= 2.0
    assert passes["draw objects"]["device_ms"] > 0.0
    # What kernels are given is no larger than all there is.
    assert 0 < delta["bytes"] <= sum(record["buffers"].values())
    compiled = {program.split()[0] for program in record["compiled"]}
    assert compiled >= {"compositing/composite.cl", "filter/mask.cl"}

    events = json.loads(trace.read_text())["traceEvents"]
    check_trace(events)
    names = [event["name"] for event in events]
    assert names.count("frame 15") == 1
    assert "frame 16" not in names  # the warm-up and the frames that are counted are not shown
    assert names.count("trace_delta") >= 16

    told = json.loads(printed(room, "--repeat", 16, "--compare", old, "--json"))
    rows = {(row["name"], row["part"]): row for row in told["changes"]}
    assert rows["trace real", "trace_delta"]["before_ms"] == delta["timing"]["ms"]
    assert all(row["noise_ms"] > 0.0 for row in told["changes"] if row["after_ms"] is not None)


@pytest.mark.thorough
@pytest.mark.gl
def test_a_video_plays(tmp_path: Path, printed: Callable[..., str]) -> None:
    clip = write_clip(tmp_path / "clip", 3)
    record = json.loads(printed(clip, "--method", "ibl", "--repeat", 2, "--json"))
    launches = {row["name"]: row["launches"] for row in record["passes"]}
    # Frames are read and looked at. Their depth is one picture, whose surfaces stay.
    assert launches["picture"] >= 1.0
    assert {"read video", "resample", "composite"} <= launches.keys()
    assert not {"surfaces", "pyramid"} & launches.keys()
    assert launches["composite"] == 1.0


@pytest.mark.thorough
@pytest.mark.gl
def test_tables_name_kernels_buffers_and_programs(room: Path, printed: Callable[..., str]) -> None:
    text = printed(room, "--repeat", 1)
    for part in ("trace_delta", "active", "MiB", "compositing/composite.cl", "frames/s"):
        assert part in text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--repeat", "0"), "--repeat 0: expected 1 to"),
        (("--compare", "x.json"), "x.json: cannot be read"),
        (("--trace", "scene.toml"), "belongs to the scene"),
        (("--trace", "old.json", "--compare", "old.json"), "is the file of --compare; name"),
        (("--view", "nowhere"), "has no such view"),
    ],
)
def test_bad_use_is_told_in_one_line(
    room: Path, fails: Callable[..., str], monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...], says: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(room)
    write_report(room / "old.json", report_of(a_profile(), (1.0,)))
    assert says in fails("profile", room, *words)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"ms": float("nan")}, "wall: ms: Input should be a finite number"),
        ({"error_ms": -1.0}, "wall: error_ms: Input should be greater than or equal to 0"),
    ],
)
def test_a_profile_that_tells_no_times_is_refused(
    room: Path, tmp_path: Path, fails: Callable[..., str], wrong: dict[str, Any], says: str
) -> None:
    old = tmp_path / "old.json"
    write_report(old, report_of(a_profile(), (1.0,)))
    record = json.loads(old.read_text())
    record["wall"] |= wrong
    old.write_text(json.dumps(record))
    assert f"{old}: {says}" in fails("profile", room, "--compare", old)


def test_another_view_is_refused_before_anything_is_measured(
    room: Path, tmp_path: Path, fails: Callable[..., str], device: ComputeDevice
) -> None:
    old = tmp_path / "old.json"
    write_report(old, replace(report_of(a_profile()), scene="box", device=device.name))
    words = ("--compare", old, "--device", device.device.platform.name)
    line = fails("profile", room, *words)
    assert f"--compare {old}: was measured with width 40, not 32; measure it again" in line


def a_profile() -> Profile:
    profile = Profile()
    frame(profile, {"march": 1.0})
    return profile
