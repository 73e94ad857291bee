"""Cost per frame of passes, kernels, transfers and host work."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from iprt.device.counting import Rays, Work
from iprt.device.profile import Cost, FrameCosts, Key, Kind, by_pass, pass_time

BLOCKS = 8
"""Number of blocks of consecutive frames for the bootstrap of a median."""
RESAMPLES = 400
"""Number of bootstrap samples, each of `BLOCKS` blocks drawn with replacement."""
FEWEST_FRAMES = 2 * BLOCKS
"""Least number of frames for a standard error."""

Milliseconds = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
"""A time; files with others are refused."""


@dataclass(frozen=True)
class Timing:
    """Statistics of the milliseconds of frames.

    Attributes
    ----------
    ms, p95_ms, mean_ms : float
        Median, 95th percentile and mean. Unlike means, medians of parts do not add up to the
        median of the whole.
    error_ms : float or None
        Standard error of the median, by a block bootstrap with `BLOCKS` blocks of consecutive
        frames, which accounts for correlated noise. None for fewer than `FEWEST_FRAMES` frames.
    """

    ms: Milliseconds
    p95_ms: Milliseconds
    mean_ms: Milliseconds
    error_ms: Milliseconds | None

    @classmethod
    def of(cls, values: Sequence[float]) -> Timing:
        """Compute the statistics of at least one frame time, in order."""
        error = _median_error(np.array(values)) if len(values) >= FEWEST_FRAMES else None
        return cls(float(median(values)), float(np.percentile(values, 95)), fmean(values), error)


def _median_error(values: NDArray[np.float64]) -> float:
    length = len(values) // BLOCKS
    blocks = values[len(values) - BLOCKS * length :].reshape(BLOCKS, length)
    drawn = np.random.default_rng(0).integers(BLOCKS, size=(RESAMPLES, BLOCKS))
    medians = np.median(blocks[drawn].reshape(RESAMPLES, -1), axis=1)
    # Half the distance between the quantiles of a normal distribution at -1 and +1 standard
    # deviations. The sample's standard deviation would be dominated by one disturbed block.
    return 0.5 * float(np.diff(np.quantile(medians, (0.1587, 0.8413)))[0])


@dataclass(frozen=True)
class RayRow:
    """Rays of a kernel per frame, the average steps of a ray, and the most in all frames."""

    count: float
    steps: float
    most: int

    @classmethod
    def of(cls, rays: Rays, frames: int) -> RayRow:
        """Divide the sum over `frames` frames."""
        return cls(rays.count / frames, rays.steps / max(rays.count, 1), rays.most_steps)


@dataclass(frozen=True)
class WorkRow:
    """Work of a kernel per frame; see `iprt.device.counting`.

    Attributes
    ----------
    items, active, groups, active_groups : float
        Work items and work groups: launched, and with work to do.
    real, objects : RayRow
        Rays through the panorama, and rays towards objects.
    """

    items: float
    active: float
    groups: float
    active_groups: float
    real: RayRow
    objects: RayRow

    @classmethod
    def of(cls, work: Work, frames: int) -> WorkRow:
        """Divide the sum over `frames` frames."""
        return cls(
            items=work.items / frames,
            active=work.active / frames,
            groups=work.groups / frames,
            active_groups=work.active_groups / frames,
            real=RayRow.of(work.real, frames),
            objects=RayRow.of(work.objects, frames),
        )


@dataclass(frozen=True)
class PartRow:
    """Cost of a kernel, a kind of transfer or a host section in a pass.

    Attributes
    ----------
    share : float
        Fraction of the mean time of a frame, in [0, 1].
    launches, bytes : float
        Averages per frame; see `Cost`.
    gb_per_s : float or None
        Bandwidth in 10^9 bytes per second. None for host work, and for kernels that follow rays
        or lists, whose traffic does not follow from the sizes of their buffers.
    work : WorkRow or None
        Counted work of the kernel, if any.
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
    """Cost of a pass.

    Attributes
    ----------
    timing : Timing
        Device and host together.
    share, launches : float
        See `PartRow`; transfers count as launches.
    device_ms, host_ms : float
        Medians of device time and host work.
    enqueue_ms : float
        Median of the host time to enqueue the pass, during which the device may run.
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
        """Median in ms."""
        return self.timing.ms


Counted = Mapping[tuple[str, str], WorkRow]
"""Work by pass and kernel."""


def frame_timing(frames: Sequence[FrameCosts]) -> Timing:
    """Compute the statistics of the total time of all passes of a frame."""
    return Timing.of([_ms(costs.items()) for costs in frames])


def pass_rows(frames: Sequence[FrameCosts], counted: Counted | None = None) -> list[PassRow]:
    """Build a row per pass, in the order in which the passes first ran.

    A pass that is missing from a frame counts as zero time.
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
"""Kinds of cost that add up to the time of a pass."""


def _ms(costs: Iterable[tuple[Key, Cost]], kinds: Iterable[Kind] = PASS_KINDS) -> float:
    return sum(cost.ms for key, cost in costs if key.kind in kinds)


def _share(timing: Timing, total: float) -> float:
    return timing.mean_ms / total if total > 0.0 else 0.0
