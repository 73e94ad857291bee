"""`iprt profile`, from the command line to its output, on scenes of a few pixels."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from iprt import cli
from iprt.device.compute import ComputeDevice
from iprt.device.profile import Kind
from tests.clips import write_clip
from tests.output.test_timeline import check_trace
from tests.scene.files import MANIFEST, OBJECT, VIEW, write_scene

SIZE = ("--size", "18", "12")
QUICK = ("--set", "irradiance.rows=16", "--set", "iprt.ratio_rows=16")


OLD = {
    **{"schema": 1, "version": "1", "scene": "box", "frames": 1, "settings": {}, "passes": []},
    **{"ms": 1.0, "error_ms": None, "wall_ms": None, "wall_error_ms": None},
    **{"device": "a device", "view": {"width": 5}},
}
"""A profile of before."""


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
    assert (record["frames"], record["width"], record["height"]) == (16, 18, 12)
    passes = {row["name"]: row for row in record["passes"]}
    assert sum(row["share"] for row in record["passes"]) == pytest.approx(1.0)
    for row in record["passes"]:
        assert sum(part["mean_ms"] for part in row["parts"]) == pytest.approx(row["mean_ms"])
    assert record["mean_ms"] == pytest.approx(sum(row["mean_ms"] for row in record["passes"]))
    (delta,) = passes["trace real"]["parts"]
    assert (delta["name"], delta["kind"], delta["launches"]) == ("trace_delta", Kind.KERNEL, 1.0)
    assert 0.0 < delta["work"]["active"] <= delta["work"]["items"] == 18 * 12
    assert delta["work"]["object_steps"] >= 2.0
    assert passes["trace view"]["device_ms"] > 0.0
    # What kernels are given is no larger than all there is.
    assert 0 < delta["bytes"] <= sum(record["buffers"].values())
    compiled = {program.split()[0] for program in record["compiled"]}
    assert compiled >= {"view/composite.cl", "filter/mask.cl"}
    assert record["compile_ms"] == pytest.approx(
        sum(record["compiled"].values()) + sum(record["first_launches"].values())
    )

    events = json.loads(trace.read_text())["traceEvents"]
    check_trace(events)
    names = [event["name"] for event in events]
    assert names.count("frame 15") == 1
    assert "frame 16" not in names  # the warm-up and the frames that are counted are not shown
    assert names.count("trace_delta") >= 16

    told = json.loads(printed(room, "--repeat", 16, "--compare", old, "--json"))
    rows = {(row["name"], row["part"]): row for row in told["changes"]}
    assert rows["trace real", "trace_delta"]["before_ms"] == delta["ms"]
    assert all(row["noise_ms"] > 0.0 for row in told["changes"] if row["after_ms"] is not None)


@pytest.mark.thorough
@pytest.mark.gl
def test_a_video_plays(tmp_path: Path, printed: Callable[..., str]) -> None:
    clip = write_clip(tmp_path / "clip", 3)
    rows = list(
        csv.DictReader(io.StringIO(printed(clip, "--method", "ibl", "--repeat", 2, "--csv")))
    )
    launches = {row["pass"]: float(row["launches"]) for row in rows if row["kind"] == "pass"}
    # Frames are read, become surfaces and pyramids, and are looked at.
    assert launches["surface"] >= 1.0
    assert {"read video", "pyramid", "resample", "composite"} <= launches.keys()
    assert launches["composite"] == 1.0
    # A device that is shared may have compiled all it needs; what it has is not part of a pass.
    programs = [row for row in rows if row["kind"] == "program"]
    assert any(row["part"].startswith("view/composite.cl") for row in programs)
    assert all(float(row["build_ms"]) >= 0.0 <= float(row["first_launch_ms"]) for row in programs)
    assert all(row["pass"] == "" and row["ms"] == "" for row in programs)


@pytest.mark.thorough
@pytest.mark.gl
def test_tables_name_kernels_buffers_and_programs(room: Path, printed: Callable[..., str]) -> None:
    text = printed(room, "--repeat", 1)
    for part in ("trace_delta", "active", "MiB", "view/composite.cl", "frames/s"):
        assert part in text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--repeat", "0"), "--repeat 0: expected 1 to"),
        (("--json", "--csv"), "--json and --csv: give one of them"),
        (("--csv", "--compare", "x.json"), "--compare: is for a table or --json"),
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
    (room / "old.json").write_text(json.dumps(OLD))
    assert says in fails("profile", room, *words)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"ms": float("nan")}, "ms: Input should be a finite number"),
        ({"wall_error_ms": -1.0}, "wall_error_ms: Input should be greater than or equal to 0"),
        ({"schema": 9}, "has schema 9"),
    ],
)
def test_a_profile_that_tells_no_times_is_refused(
    room: Path, tmp_path: Path, fails: Callable[..., str], wrong: dict[str, Any], says: str
) -> None:
    old = tmp_path / "old.json"
    old.write_text(json.dumps({**OLD, **wrong}))
    assert f"{old}: {says}" in fails("profile", room, "--compare", old)


def test_another_view_is_refused_before_anything_is_measured(
    room: Path, tmp_path: Path, fails: Callable[..., str], device: ComputeDevice
) -> None:
    old = tmp_path / "old.json"
    old.write_text(json.dumps({**OLD, "device": device.name}))
    words = ("--compare", old, "--device", device.device.platform.name)
    line = fails("profile", room, *words)
    assert f"--compare {old}: was measured with width 5, not 32; measure it again" in line
