"""Which of several ways to the same result is the fastest on a device."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from statistics import median
from typing import Protocol

ROUNDS = 3
"""How often each way is timed, in turns, so that what slows the machine down slows all of them."""


class Waiting(Protocol):
    """The part of `iprt.device.compute.ComputeDevice` that is needed."""

    def wait(self) -> None: ...


def timed_ways(device: Waiting, ways: Mapping[str, Callable[[], None]]) -> dict[str, float]:
    """Median milliseconds of each way from its begin until the device has finished.

    Each is taken once before, as kernels are compiled when they are launched first.
    """
    for way in ways.values():
        way()
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, way in ways.items():
            device.wait()
            start = time.perf_counter()
            way()
            device.wait()
            times[name].append((time.perf_counter() - start) * 1e3)
    return {name: median(of_way) for name, of_way in times.items()}
