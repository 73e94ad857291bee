"""Where the time goes: OpenCL events, host work and compile time, per frame, pass and kernel."""

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
"""The pass of what no section names."""
_OUTER = nullcontext()
"""A section inside another: events belong to that one."""
MOST_FRAMES = 1024
"""Frames whose costs are kept one by one; of more, so many chosen at random."""
SAMPLED_S = 0.05
"""Between recorded frames where nobody asked for all. Recording one takes the host up to 0.9 ms, so
never more than 2% of the time."""
MOST_PENDING = 1024
"""Events that wait to be read: many at once take a quarter of the time that each frame's take."""


class Kind(StrEnum):
    """Kinds of costs."""

    KERNEL = "kernel"
    TRANSFER = "transfer"
    HOST = "host"
    """Work of the host that a pass consists of, such as rasterization."""
    ENQUEUE = "enqueue"
    """Host time spent on a pass of the device, which meanwhile may run."""


class Key(NamedTuple):
    """Source of a cost: a kernel, a kind of transfer or a host section of a pass."""

    pass_name: str
    name: str
    kind: Kind


@dataclass(slots=True)
class Cost:
    """Cost in a frame.

    Attributes
    ----------
    ms : float
    launches : int
    bytes : int
        What a transfer moved. For a kernel: what the buffers bound to it hold, each counted once.
    """

    ms: float = 0.0
    launches: int = 0
    bytes: int = 0

    def add(self, ms: float, launches: int, size: int) -> None:
        self.ms += ms
        self.launches += launches
        self.bytes += size


FrameCosts = dict[Key, Cost]
"""Costs of a frame, in the order in which they came up."""


class Span(NamedTuple):
    """Something that ran once, in nanoseconds of `time.perf_counter_ns`."""

    key: Key
    frame: int
    start_ns: int
    end_ns: int
    bytes: int


class _Launch(NamedTuple):
    """An event, and the host's time just after it was enqueued."""

    key: Key
    frame: int
    event: Any
    enqueued_ns: int
    bytes: int


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
    """Collects events under the name of the pass that is current; resolves them on demand.

    Attributes
    ----------
    frames : int
        Those that were recorded and have ended since `reset`.
    waits : int
        How often since `reset` the host has waited for the device.
    every_s : float
        Least seconds from the begin of one recorded frame to the next; 0: all are recorded.
    recording : bool
        The present frame is recorded.
    compiled, first_launches : dict of str to float
        Milliseconds by program, to build it and beyond what its kernels ran when each was launched
        first: some drivers compile only then. Never forgotten.
    """

    def __init__(self) -> None:
        self.compiled: dict[str, float] = {}
        self.first_launches: dict[str, float] = {}
        self._pass = OTHER
        self._keys: dict[tuple[Any, ...], Key] = {}
        self._sections: dict[str, _Section] = {}
        self._trace: list[Span] | None = None
        self._clock_ns: int | None = None  # of the host, less that of the device's events
        self.every_s = 0.0
        self.recording = True
        self._began_s = time.perf_counter()  # the last frame that was recorded
        self.reset()

    def reset(self) -> None:
        """Forget passes and frames; compile time stays."""
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
        """The pass that events are recorded for now."""
        return self._pass

    @property
    def compile_ms(self) -> float:
        """All programs together, built and launched first."""
        return sum(self.compiled.values()) + sum(self.first_launches.values())

    # Recording ------------------------------------------------------------------------------

    def section(self, name: str) -> AbstractContextManager[None]:
        """Device events recorded inside belong to the pass `name`, or to the one around it."""
        if self._pass != OTHER:
            return _OUTER
        return self._sections.get(name) or self._sections.setdefault(name, _Section(self, name))

    @contextmanager
    def host(self, name: str) -> Iterator[None]:
        """Wall time inside is host work of the pass `name`; enqueue no kernels here."""
        start = time.perf_counter_ns()
        try:
            yield
        finally:
            self._host(name, Kind.HOST, start)

    def _host(self, name: str, kind: Kind, start: int) -> None:
        if not self.recording:
            return
        key = self._key(name, name, kind)
        self._pending.append(Span(key, self.frames, start, time.perf_counter_ns(), 0))

    def _key(self, *parts: Any) -> Key:
        """Always the same object, which is quicker to look up than to make."""
        return self._keys.get(parts) or self._keys.setdefault(parts, Key(*parts))

    @contextmanager
    def compiling(self, program: str) -> Iterator[None]:
        """Wall time inside goes to compiling `program`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            elapsed = (time.perf_counter() - start) * 1e3
            self.compiled[program] = self.compiled.get(program, 0.0) + elapsed

    def launched_first(self, program: str, event: Any, ms: float) -> None:
        """A kernel of `program` was launched for the first time, all by itself.

        Parameters
        ----------
        program : str
        event : pyopencl.Event
            Event of the launch, which is done.
        ms : float
            The host's time, from before it was enqueued until it was done.
        """
        told = event.get_profiling_info
        beyond = max(ms - (told(END) - told(START)) * 1e-6, 0.0)
        self.first_launches[program] = self.first_launches.get(program, 0.0) + beyond

    def record(self, event: Any, name: str, kind: Kind, size: int) -> None:
        """Take note of what has just been enqueued, in the current pass.

        Parameters
        ----------
        event : pyopencl.Event
        name : str
            Name of the kernel, or what kind of transfer it is.
        kind : Kind
        size : int
            Bytes; see `Cost`.
        """
        if not self.recording:
            return
        key = self._key(self._pass, name, kind)
        self._pending.append(_Launch(key, self.frames, event, time.perf_counter_ns(), size))

    def synchronised(self) -> None:
        """The host waits for the device."""
        self.waits += 1

    def end_frame(self) -> None:
        """End the frame: later records belong to the next one."""
        if self.recording:
            self.frames += 1
        now = time.perf_counter()
        self.recording = now - self._began_s >= self.every_s
        if self.recording:
            self._began_s = now

    def trace(self) -> None:
        """From now on keep every span, for `spans`: a hundred bytes for each launch."""
        self._trace = []

    # Results --------------------------------------------------------------------------------

    def finished(self) -> None:
        """The queue has finished: `resolve`, if it is time to."""
        if len(self._pending) >= MOST_PENDING:
            self.resolve()

    def resolve(self) -> None:
        """Add up the events recorded so far. Call after the queue has finished."""
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
        """In the device's own time."""
        told = launch.event.get_profiling_info  # `event.profile` takes ten times as long
        if self._trace is not None:
            # The event was queued before the host looked at its own clock, once just before.
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
            # Reservoir sampling: every frame is as likely to be kept as any other.
            kept = (self._current_frame, costs)
            if len(self._kept) < MOST_FRAMES:
                self._kept.append(kept)
            elif (place := self._random.randrange(self._current_frame + 1)) < MOST_FRAMES:
                self._kept[place] = kept
            self._current = {}
            self._current_frame += 1

    def kept_frames(self) -> list[FrameCosts]:
        """Costs of each frame that has ended, in order, or of `MOST_FRAMES` of them."""
        self.resolve()
        return [costs for _, costs in sorted(self._kept, key=lambda kept: kept[0])]

    def totals(self) -> FrameCosts:
        """Costs since `reset`, summed; those of a frame that has not ended included."""
        self.resolve()
        sums = {key: Cost(cost.ms, cost.launches, cost.bytes) for key, cost in self._totals.items()}
        for key, cost in self._current.items():
            sums.setdefault(key, Cost()).add(cost.ms, cost.launches, cost.bytes)
        return sums

    def passes(self) -> list[PassTime]:
        """Times per pass, summed, in the order in which the passes first ran."""
        return [pass_time(name, costs) for name, costs in by_pass(self.totals()).items()]

    def prepared(self) -> float:
        """Milliseconds that passes took so far, which are forgotten: the frames begin now."""
        elapsed = sum(entry.ms for entry in self.passes())
        self.reset()
        return elapsed

    def spans(self) -> list[Span]:
        """All that ran since `trace` or `reset`, in the order of recording, by the host's clock."""
        self.resolve()
        shift = self._clock_ns or 0
        return [
            span
            if span.key.kind in (Kind.HOST, Kind.ENQUEUE)
            else span._replace(start_ns=span.start_ns + shift, end_ns=span.end_ns + shift)
            for span in self._trace or ()
        ]


class _Section:
    """Context of a pass, to which recorded costs belong. A generator would take twice the time."""

    __slots__ = ("_name", "_profile", "_start")

    def __init__(self, profile: Profile, name: str) -> None:
        self._profile = profile
        self._name = name

    def __enter__(self) -> None:
        self._profile._pass = self._name
        if self._profile.recording:
            self._start = time.perf_counter_ns()

    def __exit__(self, *_: object) -> None:
        self._profile._pass = OTHER
        if self._profile.recording:
            self._profile._host(self._name, Kind.ENQUEUE, self._start)


def by_pass(costs: FrameCosts) -> dict[str, FrameCosts]:
    """The same costs, those of each pass for themselves."""
    passes: dict[str, FrameCosts] = {}
    for key, cost in costs.items():
        passes.setdefault(key.pass_name, {})[key] = cost
    return passes


def pass_time(name: str, costs: FrameCosts) -> PassTime:
    """The sum of what a pass consists of."""
    device = [costs[key] for key in costs if key.kind in (Kind.KERNEL, Kind.TRANSFER)]
    host = [costs[key] for key in costs if key.kind is Kind.HOST]
    return PassTime(
        name,
        sum(cost.ms for cost in device),
        sum(cost.ms for cost in host),
        sum(cost.launches for cost in device),
    )
