"""Timing of alternative implementations on a device."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from statistics import median
from typing import Protocol

ROUNDS = 3
"""Timed rounds. Alternatives are interleaved, so that a slowdown of the machine hits all alike."""


class Waiting(Protocol):
    """Interface of `iprt.device.compute.ComputeDevice` needed for timing."""

    def wait(self) -> None:
        """Wait until all enqueued work is done."""


def timed_ways(device: Waiting, ways: Mapping[str, Callable[[], None]]) -> dict[str, float]:
    """Return the median wall time in ms of each alternative, until the device has finished.

    Each runs once untimed before, because kernels are compiled at their first launch.
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
