"""Times of kernels in the frames that `docs/gpu.md` models, beside the model's."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from docs.gpu import PAGE, modelled
from docs.gpu_counts import FRAME, FULL, GBUFFER, VIDEO, Size, playing
from iprt.device.compute import ComputeDevice
from iprt.device.profile import Kind
from tests.on_device.conftest import OUT

REPEATED, REPEATED_BY_CPU = 20, 2
SMALLER = Size(256, 512, 2, GBUFFER)
"""Size for a processor."""


def test_kernels(device: ComputeDevice, tell: Callable[..., None]) -> None:
    """Tell the time of each kernel of each pass; write `gpu_measured.json` for `docs/gpu.py`."""
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
    (OUT / "gpu_measured.json").write_text(json.dumps({"devices": [record]}, indent=1) + "\n")
    page = PAGE.read_text(encoding="utf-8")
    for what in (FRAME, VIDEO):
        known = modelled(page, what) if size is FULL else {}
        kernels = played[what]["kernels"]
        for part, name, ms in kernels:
            tell(frame=what, kernel=f"{part}: {name}", ms=ms, **known.get((part, name), {}))
        total = sum(ms for *_, ms in kernels)
        tell(frame=what, kernel="all", ms=total, wall_ms=played[what]["wall_ms"])
