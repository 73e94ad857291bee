"""Profile of OpenCL events, host work and compile time, per frame, pass and kernel."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

from pyopencl import profiling_info

QUEUED, START, END = profiling_info.QUEUED, profiling_info.START, profiling_info.END

OTHER = "other"
"""Pass of events outside of all sections."""
_OUTER = nullcontext()
"""Context of a nested section: its events belong to the outer one."""
MOST_FRAMES = 1024
"""Number of frames whose costs are kept one by one. Of more frames, a random sample is kept."""
SAMPLED_S = 0.05
"""Default seconds between recorded frames. Recording a frame takes up to 0.9 ms of host time, so at
most 2% of the time."""
MOST_PENDING = 1024
"""Events that are read in one batch, which takes a quarter of the time of reading every frame."""


class Kind(StrEnum):
    """Kinds of costs."""

    KERNEL = "kernel"
    TRANSFER = "transfer"
    HOST = "host"
    """Host work that belongs to a pass, such as rasterization."""
    ENQUEUE = "enqueue"
    """Host time to enqueue a pass of the device, which may run at the same time."""


class Key(NamedTuple):
    """Source of a cost: a kernel, a kind of transfer or a host section of a pass."""

    pass_name: str
    name: str
    kind: Kind


@dataclass(slots=True)
class Cost:
    """Cost of one source in a frame.

    Attributes
    ----------
    ms : float
    launches : int
    bytes : int
        Size of a transfer. For a kernel: size of its bound buffers, each counted once.
    """

    ms: float = 0.0
    launches: int = 0
    bytes: int = 0

    def add(self, ms: float, launches: int, size: int) -> None:
        """Add time, launches and bytes."""
        self.ms += ms
        self.launches += launches
        self.bytes += size


FrameCosts = dict[Key, Cost]
"""Costs of a frame, in the order of their first record."""


class Span(NamedTuple):
    """Time span of one launch, transfer or host section, in ns of `time.perf_counter_ns`."""

    key: Key
    frame: int
    start_ns: int
    end_ns: int
    bytes: int


class _Launch(NamedTuple):
    """An event, with the host's clock just after it was enqueued."""

    key: Key
    frame: int
    event: Any
    enqueued_ns: int
    bytes: int


@dataclass(frozen=True)
class PassTime:
    """Time of one pass, summed over the profiled frames.

    Attributes
    ----------
    name : str
    device_ms, host_ms : float
        Time of kernels and transfers by device events, and time of host work (rasterization).
    launches : int
        Number of kernel launches and transfers.
    """

    name: str
    device_ms: float
    host_ms: float
    launches: int

    @property
    def ms(self) -> float:
        """Device and host time."""
        return self.device_ms + self.host_ms


class Profile:
    """Recorder of events under the name of the current pass. Event times are read on demand.

    Attributes
    ----------
    frames : int
        Number of recorded frames that have ended since `reset`.
    waits : int
        Number of times since `reset` that the host has waited for the device.
    every_s : float
        Least seconds between the starts of two recorded frames. 0: all are recorded.
    recording : bool
        The current frame is recorded.
    compiled, first_launches : dict of str to float
        Milliseconds by program: time to build it, and overhead of its kernels' first launches, at
        which some drivers compile. `reset` keeps both.
    """

    def __init__(self) -> None:
        self.compiled: dict[str, float] = {}
        self.first_launches: dict[str, float] = {}
        self._pass = OTHER
        self._keys: dict[tuple[Any, ...], Key] = {}
        self._sections: dict[str, _Section] = {}
        self._trace: list[Span] | None = None
        self._clock_ns: int | None = None  # host clock minus device clock
        self.every_s = 0.0
        self.recording = True
        self._recorded = 0  # launches, transfers and host sections so far
        self._began_s = time.perf_counter()  # start of the last recorded frame
        self.reset()

    def reset(self) -> None:
        """Forget passes and frames, but keep compile times."""
        self.frames = self.waits = 0
        self._pending: list[_Launch | Span] = []
        self._current: FrameCosts = {}
        self._current_frame = 0
        self._totals: FrameCosts = {}
        self._kept: list[tuple[int, FrameCosts]] = []
        self._random = random.Random(0)
        if self._trace is not None:
            self._trace = []

    @property
    def current(self) -> str:
        """Name of the current pass."""
        return self._pass

    @property
    def compile_ms(self) -> float:
        """Total time in ms to compile all programs, in builds and first launches."""
        return sum(self.compiled.values()) + sum(self.first_launches.values())

    # Recording ------------------------------------------------------------------------------

    def section(self, name: str) -> AbstractContextManager[None]:
        """Record the events of a `with` block under pass `name`, unless another pass encloses it.

        The enqueue time of the block is recorded too, if it launches anything.
        """
        if self._pass != OTHER:
            return _OUTER
        return self._sections.get(name) or self._sections.setdefault(name, _Section(self, name))

    @contextmanager
    def host(self, name: str) -> Iterator[None]:
        """Record the wall time of a `with` block as host work of the current pass, else of `name`.

        The block must not enqueue kernels.
        """
        start = time.perf_counter_ns()
        try:
            yield
        finally:
            self._host(name, Kind.HOST, start)

    def _host(self, name: str, kind: Kind, start: int) -> None:
        if not self.recording:
            return
        self._recorded += 1
        inside = name if self._pass == OTHER else self._pass
        key = self._key(inside, name, kind)
        self._pending.append(Span(key, self.frames, start, time.perf_counter_ns(), 0))

    def _key(self, *parts: Any) -> Key:
        """Return the `Key` of these fields. Looking it up is quicker than making one."""
        return self._keys.get(parts) or self._keys.setdefault(parts, Key(*parts))

    @contextmanager
    def compiling(self, program: str) -> Iterator[None]:
        """Record the wall time of a `with` block as compile time of `program`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            elapsed = (time.perf_counter() - start) * 1e3
            self.compiled[program] = self.compiled.get(program, 0.0) + elapsed

    def launched_first(self, program: str, event: Any, ms: float) -> None:
        """Record the first launch of a kernel of `program`, on an otherwise empty queue.

        Parameters
        ----------
        program : str
        event : pyopencl.Event
            Finished event of the launch.
        ms : float
            Host time from before the enqueue to the end of the launch.
        """
        told = event.get_profiling_info
        beyond = max(ms - (told(END) - told(START)) * 1e-6, 0.0)
        self.first_launches[program] = self.first_launches.get(program, 0.0) + beyond

    def record(self, event: Any, name: str, kind: Kind, size: int) -> None:
        """Record a launch or transfer, just after it was enqueued, in the current pass.

        Parameters
        ----------
        event : pyopencl.Event
        name : str
            Name of the kernel, or kind of transfer.
        kind : Kind
        size : int
            Bytes; see `Cost`.
        """
        if not self.recording:
            return
        self._recorded += 1
        key = self._key(self._pass, name, kind)
        self._pending.append(_Launch(key, self.frames, event, time.perf_counter_ns(), size))

    def synchronised(self) -> None:
        """Count a wait of the host for the device."""
        self.waits += 1

    def end_frame(self) -> None:
        """End the frame and decide whether to record the next one."""
        if self.recording:
            self.frames += 1
        now = time.perf_counter()
        self.recording = now - self._began_s >= self.every_s
        if self.recording:
            self._began_s = now

    def trace(self) -> None:
        """Start to keep every span for `spans`, at a hundred bytes per launch."""
        self._trace = []

    # Results --------------------------------------------------------------------------------

    def finished(self) -> None:
        """Read event times if enough are pending. Call after the queue has finished."""
        if len(self._pending) >= MOST_PENDING:
            self.resolve()

    def resolve(self) -> None:
        """Read the times of all pending events. Call after the queue has finished."""
        for entry in self._pending:
            if entry.frame > self._current_frame:
                self._close_frames(entry.frame)
            span = entry if isinstance(entry, Span) else self._timed(entry)
            cost = self._current.get(span.key)
            if cost is None:
                cost = self._current[span.key] = Cost()
            cost.add((span.end_ns - span.start_ns) * 1e-6, 1, span.bytes)
            if self._trace is not None:
                self._trace.append(span)
        self._pending.clear()
        self._close_frames(self.frames)

    def _timed(self, launch: _Launch) -> Span:
        """Return the span of a launch, in the device's clock."""
        told = launch.event.get_profiling_info  # `event.profile` takes ten times as long
        if self._trace is not None:
            # The host reads its clock after the event is queued. The least difference of the two
            # clocks is the best estimate of their offset.
            least = launch.enqueued_ns - told(QUEUED)
            self._clock_ns = least if self._clock_ns is None else min(self._clock_ns, least)
        return Span(launch.key, launch.frame, told(START), told(END), launch.bytes)

    def _close_frames(self, frame: int) -> None:
        """Keep the costs of the frames before `frame`."""
        while self._current_frame < frame:
            costs = self._current
            for key, cost in costs.items():
                total = self._totals.setdefault(key, Cost())
                total.add(cost.ms, cost.launches, cost.bytes)
            # Reservoir sampling: all frames are kept with the same probability.
            kept = (self._current_frame, costs)
            if len(self._kept) < MOST_FRAMES:
                self._kept.append(kept)
            elif (place := self._random.randrange(self._current_frame + 1)) < MOST_FRAMES:
                self._kept[place] = kept
            self._current = {}
            self._current_frame += 1

    def kept_frames(self) -> list[FrameCosts]:
        """Return the costs of the ended frames in order, at most `MOST_FRAMES` sampled ones."""
        self.resolve()
        return [costs for _, costs in sorted(self._kept, key=lambda kept: kept[0])]

    def totals(self) -> FrameCosts:
        """Sum the costs since `reset`, including the current frame."""
        self.resolve()
        sums = {key: Cost(cost.ms, cost.launches, cost.bytes) for key, cost in self._totals.items()}
        for key, cost in self._current.items():
            sums.setdefault(key, Cost()).add(cost.ms, cost.launches, cost.bytes)
        return sums

    def passes(self) -> list[PassTime]:
        """Return the summed time of each pass, in the order in which the passes first ran."""
        return [pass_time(name, costs) for name, costs in by_pass(self.totals()).items()]

    def prepared(self) -> float:
        """Return the ms of all passes so far and reset, so that the next frame is the first."""
        elapsed = sum(entry.ms for entry in self.passes())
        self.reset()
        return elapsed

    def spans(self) -> list[Span]:
        """Return all spans since `trace` or `reset`, as recorded, in the host's clock."""
        self.resolve()
        shift = self._clock_ns or 0
        return [
            span
            if span.key.kind in (Kind.HOST, Kind.ENQUEUE)
            else span._replace(start_ns=span.start_ns + shift, end_ns=span.end_ns + shift)
            for span in self._trace or ()
        ]


class _Section:
    """Context manager of a pass. A generator-based one would take twice the time."""

    __slots__ = ("_before", "_name", "_profile", "_start")

    def __init__(self, profile: Profile, name: str) -> None:
        self._profile = profile
        self._name = name

    def __enter__(self) -> None:
        self._profile._pass = self._name
        if self._profile.recording:
            self._before = self._profile._recorded
            self._start = time.perf_counter_ns()

    def __exit__(self, *_: object) -> None:
        profile = self._profile
        profile._pass = OTHER
        # A pass without launches has no row.
        if profile.recording and profile._recorded > self._before:
            profile._host(self._name, Kind.ENQUEUE, self._start)


def by_pass(costs: FrameCosts) -> dict[str, FrameCosts]:
    """Group costs by pass."""
    passes: dict[str, FrameCosts] = {}
    for key, cost in costs.items():
        passes.setdefault(key.pass_name, {})[key] = cost
    return passes


def pass_time(name: str, costs: FrameCosts) -> PassTime:
    """Sum the costs of a pass."""
    device = [costs[key] for key in costs if key.kind in (Kind.KERNEL, Kind.TRANSFER)]
    host = [costs[key] for key in costs if key.kind is Kind.HOST]
    return PassTime(
        name,
        sum(cost.ms for cost in device),
        sum(cost.ms for cost in host),
        sum(cost.launches for cost in device),
    )
