"""Where the time goes: OpenCL events, host sections and compile time, per pass."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

OTHER = "other"
"""The pass of what no section names."""


@dataclass(frozen=True)
class PassTime:
    """Time of one pass over the frames profiled.

    Attributes
    ----------
    name : str
    device_ms, host_ms : float
        Kernel and transfer time by device events, and time of host work (rasterization), summed.
    launches : int
        Kernel launches and transfers, summed.
    """

    name: str
    device_ms: float
    host_ms: float
    launches: int

    @property
    def ms(self) -> float:
        return self.device_ms + self.host_ms


class Profile:
    """Collects events under the name of the pass that is current; resolves them on demand."""

    def __init__(self) -> None:
        self.compile_ms = 0.0
        self.frames = 0
        self._pass = OTHER
        self._events: list[tuple[str, Any]] = []
        self._device_ms: dict[str, float] = {}
        self._host_ms: dict[str, float] = {}
        self._launches: dict[str, int] = {}

    @property
    def current(self) -> str:
        """The pass that events are recorded for now."""
        return self._pass

    @contextmanager
    def section(self, name: str) -> Iterator[None]:
        """Device events recorded inside belong to the pass `name`, or to the one around it."""
        outer = self._pass
        self._pass = name if outer == OTHER else outer
        try:
            yield
        finally:
            self._pass = outer

    @contextmanager
    def host(self, name: str) -> Iterator[None]:
        """Wall time inside is host work of the pass `name`; enqueue no kernels here."""
        start = time.perf_counter()
        try:
            yield
        finally:
            elapsed = (time.perf_counter() - start) * 1e3
            self._host_ms[name] = self._host_ms.get(name, 0.0) + elapsed
            self._launches.setdefault(name, 0)

    @contextmanager
    def compiling(self) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.compile_ms += (time.perf_counter() - start) * 1e3

    def record(self, event: Any) -> None:
        self._events.append((self._pass, event))

    def resolve(self) -> None:
        """Add up the events recorded so far. Call after the queue has finished."""
        for name, event in self._events:
            elapsed = (event.profile.end - event.profile.start) * 1e-6
            self._device_ms[name] = self._device_ms.get(name, 0.0) + elapsed
            self._launches[name] = self._launches.get(name, 0) + 1
        self._events.clear()

    def reset(self) -> None:
        """Forget passes and frames; compile time stays."""
        self._events.clear()
        self.frames = 0
        for table in (self._device_ms, self._host_ms, self._launches):
            table.clear()

    def passes(self) -> list[PassTime]:
        """Times per pass, in the order in which the passes first ran."""
        self.resolve()
        return [
            PassTime(name, self._device_ms.get(name, 0.0), self._host_ms.get(name, 0.0), launches)
            for name, launches in self._launches.items()
        ]
