"""The trace: what Chrome's format asks for, and that things nest as they ran."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from iprt.device.profile import Key, Kind, Span
from iprt.output.timeline import DEVICE, FRAMES, HOST, trace_events, write_trace

US = 1000


def span(name: str, kind: Kind, start: int, end: int, frame: int = 0, part: str = "") -> Span:
    return Span(Key(name, part or name, kind), frame, start * US, end * US, 16)


SPANS = [
    # The section ends after the host work in it, and is recorded later.
    span("draw", Kind.HOST, 105, 115),
    span("march", Kind.ENQUEUE, 105, 120),
    span("march", Kind.KERNEL, 130, 150, part="trace"),
    span("march", Kind.TRANSFER, 149, 160, part="write"),  # by the device's clock, before its turn
    span("blend", Kind.ENQUEUE, 121, 122),
    span("blend", Kind.KERNEL, 160, 170, part="mix"),
    span("march", Kind.ENQUEUE, 200, 210, frame=1),
    span("march", Kind.KERNEL, 205, 260, frame=1, part="trace"),
]


def track(number: int) -> list[tuple[str, float, float]]:
    return [
        (e["name"], e["ts"], e["dur"])  # type: ignore[misc]
        for e in trace_events(SPANS, "a device")
        if e["ph"] == "X" and e["tid"] == number
    ]


def test_each_track_shows_what_ran_from_the_first_on() -> None:
    assert track(FRAMES) == [("frame 0", 0.0, 65.0), ("frame 1", 95.0, 60.0)]
    assert track(HOST) == [
        ("march", 0.0, 15.0),
        ("draw", 0.0, 10.0),
        ("blend", 16.0, 1.0),
        ("march", 95.0, 10.0),
    ]
    assert track(DEVICE) == [
        ("march", 25.0, 30.0),
        ("trace", 25.0, 20.0),
        ("write", 45.0, 10.0),
        ("blend", 55.0, 10.0),
        ("mix", 55.0, 10.0),
        ("march", 100.0, 55.0),
        ("trace", 100.0, 55.0),
    ]


def test_events_are_complete_and_nest(tmp_path: Path) -> None:
    write_trace(tmp_path / "trace.json", SPANS, "a device")
    record = json.loads((tmp_path / "trace.json").read_text())
    assert record["displayTimeUnit"] == "ms"
    events: list[dict[str, Any]] = record["traceEvents"]
    named = {e["tid"]: e["args"]["name"] for e in events if e["name"] == "thread_name"}
    assert named == {FRAMES: "frames", HOST: "host", DEVICE: "a device"}
    check_trace(events)


def check_trace(events: list[dict[str, Any]]) -> None:
    """Every event has what the format asks for, and none crosses another's end."""
    assert {e["ph"] for e in events} == {"M", "X"}
    assert all(isinstance(e["pid"], int) and isinstance(e["tid"], int) for e in events)
    for number in (FRAMES, HOST, DEVICE):
        open_until: list[float] = []
        for e in (e for e in events if e["ph"] == "X" and e["tid"] == number):
            begin, end = e["ts"], e["ts"] + e["dur"]
            assert begin >= 0.0
            assert e["dur"] >= 0.0
            while open_until and open_until[-1] <= begin + 1e-3:
                open_until.pop()
            assert not open_until or end <= open_until[-1] + 1e-3, e
            open_until.append(end)


@pytest.mark.thorough
def test_a_reader_that_cuts_off_gets_every_nanosecond() -> None:
    """Perfetto makes whole nanoseconds of microseconds; what is lost of one breaks the nesting."""
    times = [*range(20_000), *(10**10 + 7 * n for n in range(20_000))]
    assert any(int(ns / 1e3 * 1e3) != ns for ns in times)
    for ns in times:
        spans = [Span(Key("march", "trace", Kind.KERNEL), 0, 0, ns, 0)]
        assert {int(e["dur"] * 1e3) for e in trace_events(spans, "") if e["ph"] == "X"} == {ns}  # type: ignore[operator]


def test_an_empty_trace_is_one() -> None:
    assert all(event["ph"] == "M" for event in trace_events([], "a device"))
