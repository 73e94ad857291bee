"""Timeline of a run, as a trace for Perfetto (ui.perfetto.dev) and Chrome's about:tracing.

After "Trace Event Format" (Google): complete events, which nest where one spans another.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

from iprt.device.profile import Kind, Span
from iprt.files.atomic import replacing

PROCESS = 1
FRAMES, HOST, DEVICE = 1, 2, 3
"""Tracks."""

Event = dict[str, object]


def trace_events(spans: Sequence[Span], device: str) -> list[Event]:
    """Return events of frames, of passes on the host, and of passes on the device.

    Passes on the device contain their kernels and transfers.

    Parameters
    ----------
    spans : sequence of Span
        From `Profile.spans`.
    device : str
        Its name.
    """
    start = min((span.start_ns for span in spans), default=0)
    events = [_metadata("process_name", 0, "iprt")]
    tracks = ((FRAMES, "frames"), (HOST, "host"), (DEVICE, device))
    events += [_metadata("thread_name", track, name) for track, name in tracks]
    events += [_metadata("thread_sort_index", track, track) for track, _ in tracks]
    host = [span for span in spans if span.key.kind in (Kind.HOST, Kind.ENQUEUE)]
    queue = _in_turn([span for span in spans if span.key.kind in (Kind.KERNEL, Kind.TRANSFER)])
    events += [_event(FRAMES, *frame, start) for frame in _frames(host, queue)]
    # A section is recorded when it ends, after the spans inside it.
    for span in sorted(host, key=lambda span: (span.start_ns, -span.end_ns)):
        events.append(_event(HOST, span.key.name, span.start_ns, span.end_ns, start, span))
    for (_, name), group in groupby(queue, key=lambda span: (span.frame, span.key.pass_name)):
        parts = list(group)
        events.append(_event(DEVICE, name, parts[0].start_ns, parts[-1].end_ns, start))
        for span in parts:
            events.append(_event(DEVICE, span.key.name, span.start_ns, span.end_ns, start, span))
    return events


def write_trace(path: Path, spans: Sequence[Span], device: str) -> None:
    """Write `trace_events` as JSON, atomically.

    Raises
    ------
    FormatError
        The file cannot be written.
    """
    record = {"traceEvents": trace_events(spans, device), "displayTimeUnit": "ms"}
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(record) + "\n", encoding="utf-8")


def _in_turn(queue: Sequence[Span]) -> list[Span]:
    """Return spans in queue order without overlaps: clocks may report small ones."""
    turns: list[Span] = []
    over = 0
    for span in sorted(queue, key=lambda span: span.start_ns):
        begin = max(span.start_ns, over)
        over = max(span.end_ns, begin)
        turns.append(span._replace(start_ns=begin, end_ns=over))
    return turns


def _frames(host: Sequence[Span], queue: Sequence[Span]) -> Iterator[tuple[str, int, int]]:
    """Yield name, start and end: from the host's first work on a frame to the device's last."""
    over = 0
    ordered = sorted([*host, *queue], key=lambda span: span.frame)
    for number, group in groupby(ordered, key=lambda span: span.frame):
        spans = list(group)
        begin = max(min(span.start_ns for span in spans), over)
        over = max(max(span.end_ns for span in spans), begin)
        yield f"frame {number}", begin, over


def _event(
    track: int, name: str, begin: int, end: int, start: int, span: Span | None = None
) -> Event:
    event: Event = {
        "ph": "X",
        "pid": PROCESS,
        "tid": track,
        "name": name,
        "ts": _microseconds(begin - start),
        "dur": _microseconds(end - begin),
    }
    if span is not None:
        event["cat"] = span.key.kind.value
        event["args"] = {"pass": span.key.pass_name, "frame": span.frame, "bytes": span.bytes}
    return event


def _microseconds(ns: int) -> float:
    """Return microseconds that Perfetto, which truncates, converts back to the same nanoseconds.

    Perfetto loses events that end a nanosecond after the event around them.
    """
    us = ns / 1e3
    return us if int(us * 1e3) == ns else math.nextafter(us, math.inf)


def _metadata(what: str, track: int, value: str | int) -> Event:
    key = "sort_index" if what.endswith("index") else "name"
    return {"ph": "M", "pid": PROCESS, "tid": track, "name": what, "args": {key: value}}
