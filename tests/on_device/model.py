"""Times of kernels in the frames that the model of `docs/gpu.md` is about, beside that."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from docs.gpu import PAGE, modelled
from docs.gpu_counts import FRAME, FULL, GBUFFER, VIDEO, Key, Size, playing
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.device.profile import Kind
from tests.on_device.cases import Asked, Cases, Row

REPEATED, REPEATED_BY_CPU = 20, 2
SMALLER = Size(256, 512, 2, GBUFFER)
"""For a processor."""


def cases(asked: Asked) -> Cases:
    """One, as both kinds of frames share what is prepared."""
    return {"room": lambda: measured(ComputeDevice(choose_device(asked.device)))}


def measured(device: ComputeDevice) -> list[Row]:
    """A row for each kernel of each pass; the first has all of them as `docs/gpu.py` takes it."""
    size, repeated = (SMALLER, REPEATED_BY_CPU) if device.is_cpu else (FULL, REPEATED)

    @contextmanager
    def watch(_: str) -> Iterator[dict[str, Any]]:
        found: dict[str, Any] = {}
        device.finish()
        device.profile.reset()
        start = time.perf_counter()
        yield found
        device.finish()
        found["wall_ms"] = 1e3 * (time.perf_counter() - start) / repeated
        found["kernels"] = [
            [key.pass_name, key.name, cost.ms / repeated]
            for key, cost in device.profile.totals().items()
            if key.kind in (Kind.KERNEL, Kind.TRANSFER)
        ]

    played = playing(device, size, watch, repeated)
    record = {
        "device": device.device.name.strip(),
        "driver": device.device.driver_version.strip(),
        "view": size.view,
        "rows": size.rows,
        **played,
    }
    page = PAGE.read_text(encoding="utf-8")
    rows: list[Row] = []
    for what in (FRAME, VIDEO):
        known = modelled(page, what) if size is FULL else {}
        kernels = played[what]["kernels"]
        rows += [_row(what, (part, name), ms, known) for part, name, ms in kernels]
        rows.append({"frame": what, "pass": "all", "ms": sum(ms for *_, ms in kernels)})
        rows.append({"frame": what, "pass": "by the clock", "ms": played[what]["wall_ms"]})
    rows[0]["measured"] = record
    return rows


def _row(what: str, key: Key, ms: float, known: dict[Key, dict[str, float]]) -> Row:
    part, name = key
    return {"frame": what, "pass": part, "kernel": name, "ms": ms, **known.get(key, {})}
