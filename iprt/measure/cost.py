"""Costs per frame: of passes, and of the kernels, transfers and host work they consist of."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median

import numpy as np
from numpy.typing import NDArray

from iprt.device.counting import Work
from iprt.device.profile import Cost, FrameCosts, Key, Kind, by_pass, pass_time

BLOCKS = 8
"""Runs of frames that are taken together when it is asked how sure a median is."""
RESAMPLES = 400
"""Draws of as many of these runs, with replacement."""
FEWEST_FRAMES = 2 * BLOCKS
"""Fewer are too few to report."""


@dataclass(frozen=True)
class Timing:
    """Milliseconds of each frame, in short.

    Attributes
    ----------
    ms, p95_ms, mean_ms : float
        Median, 95th percentile and mean. Medians of parts do not add up to that of the whole;
        means do.
    error_ms : float or None
        Standard error of the median, by a bootstrap of `BLOCKS` runs of frames, so that what
        lasts for several frames counts as noise, too. None of fewer than `FEWEST_FRAMES`.
    """

    ms: float
    p95_ms: float
    mean_ms: float
    error_ms: float | None

    @classmethod
    def of(cls, values: Sequence[float]) -> Timing:
        """From the times of frames, in order; at least one."""
        error = _median_error(np.array(values)) if len(values) >= FEWEST_FRAMES else None
        return cls(float(median(values)), float(np.percentile(values, 95)), fmean(values), error)


def _median_error(values: NDArray[np.float64]) -> float:
    length = len(values) // BLOCKS
    blocks = values[len(values) - BLOCKS * length :].reshape(BLOCKS, length)
    drawn = np.random.default_rng(0).integers(BLOCKS, size=(RESAMPLES, BLOCKS))
    medians = np.median(blocks[drawn].reshape(RESAMPLES, -1), axis=1)
    # Half of what one standard deviation to either side holds of a normal distribution: a run that
    # something else disturbed, drawn often now and then, would rule their own deviation.
    return 0.5 * float(np.diff(np.quantile(medians, (0.1587, 0.8413)))[0])


@dataclass(frozen=True)
class WorkRow:
    """The work of a kernel per frame; see `iprt.device.counting`.

    Attributes
    ----------
    rays, object_rays : float
        Through the panorama, and towards objects.
    steps, object_steps : float
        Steps of a ray, on average.
    most_steps, most_object_steps : int
        Steps of the longest march in all frames.
    """

    items: float
    active: float
    groups: float
    active_groups: float
    rays: float
    steps: float
    most_steps: int
    object_rays: float
    object_steps: float
    most_object_steps: int

    @classmethod
    def of(cls, work: Work, frames: int) -> WorkRow:
        """From the sum over frames."""
        real, objects = work.real, work.objects
        return cls(
            items=work.items / frames,
            active=work.active / frames,
            groups=work.groups / frames,
            active_groups=work.active_groups / frames,
            rays=real.count / frames,
            steps=real.steps / max(real.count, 1),
            most_steps=real.most_steps,
            object_rays=objects.count / frames,
            object_steps=objects.steps / max(objects.count, 1),
            most_object_steps=objects.most_steps,
        )


@dataclass(frozen=True)
class PartRow:
    """A kernel of a pass, a kind of transfer, or work of the host.

    Attributes
    ----------
    share : float
        Fraction of the mean time of a frame, in [0, 1].
    launches, bytes : float
        Per frame, on average; see `Cost`.
    gb_per_s : float or None
        Bytes by time, in 10^9 a second. None of host work, and of kernels that read where rays or
        lists lead them: the buffers' sizes do not say what these move.
    work : WorkRow or None
        What a kernel that counts had to do, where it was counted.
    """

    name: str
    kind: Kind
    timing: Timing
    share: float
    launches: float
    bytes: float
    gb_per_s: float | None
    work: WorkRow | None


@dataclass(frozen=True)
class PassRow:
    """A pass.

    Attributes
    ----------
    timing : Timing
        Device and host together.
    share, launches : float
        As of `PartRow`; transfers are launches.
    device_ms, host_ms : float
        Medians of what the device did, and of host work.
    enqueue_ms : float
        Median of the time that the host spent on it while the device may have run.
    """

    name: str
    timing: Timing
    share: float
    launches: float
    device_ms: float
    host_ms: float
    enqueue_ms: float
    parts: tuple[PartRow, ...]

    @property
    def ms(self) -> float:
        return self.timing.ms


Counted = Mapping[tuple[str, str], WorkRow]
"""Work by pass and kernel."""


def frame_timing(frames: Sequence[FrameCosts]) -> Timing:
    """The time of all passes of a frame together."""
    return Timing.of([_ms(costs.items()) for costs in frames])


def pass_rows(frames: Sequence[FrameCosts], counted: Counted | None = None) -> list[PassRow]:
    """A row per pass, in the order in which they first ran; none of no frames.

    A pass that a frame lacks took no time in it.
    """
    names: dict[str, dict[Key, None]] = {}
    split = [by_pass(costs) for costs in frames]
    for costs in frames:
        for key in costs:
            names.setdefault(key.pass_name, {})[key] = None
    total = sum(_ms(costs.items()) for costs in frames) / max(len(frames), 1)
    rows = []
    for name, keys in names.items():
        of_frames = [passes.get(name, {}) for passes in split]
        times = [pass_time(name, costs) for costs in of_frames]
        timing = Timing.of([time.ms for time in times])
        rows.append(
            PassRow(
                name=name,
                timing=timing,
                share=_share(timing, total),
                launches=fmean(time.launches for time in times),
                device_ms=median(time.device_ms for time in times),
                host_ms=median(time.host_ms for time in times),
                enqueue_ms=median(_ms(costs.items(), {Kind.ENQUEUE}) for costs in of_frames),
                parts=tuple(
                    _part_row(key, of_frames, total, counted or {})
                    for key in keys
                    if key.kind is not Kind.ENQUEUE
                ),
            )
        )
    return [row for row in rows if row.parts]


def _part_row(key: Key, frames: Sequence[FrameCosts], total: float, counted: Counted) -> PartRow:
    costs = [frame.get(key, Cost()) for frame in frames]
    timing = Timing.of([cost.ms for cost in costs])
    size = fmean(cost.bytes for cost in costs)
    work = counted.get((key.pass_name, key.name))
    streams = key.kind is not Kind.HOST and work is None and timing.mean_ms > 0.0
    return PartRow(
        name=key.name,
        kind=key.kind,
        timing=timing,
        share=_share(timing, total),
        launches=fmean(cost.launches for cost in costs),
        bytes=size,
        gb_per_s=size / timing.mean_ms * 1e-6 if streams else None,
        work=work,
    )


PASS_KINDS = frozenset({Kind.KERNEL, Kind.TRANSFER, Kind.HOST})
"""The kinds of cost that add up to the time of a pass."""


def _ms(costs: Iterable[tuple[Key, Cost]], kinds: Iterable[Kind] = PASS_KINDS) -> float:
    return sum(cost.ms for key, cost in costs if key.kind in kinds)


def _share(timing: Timing, total: float) -> float:
    return timing.mean_ms / total if total > 0.0 else 0.0
