"""Benchmark of a reel: times per frame, and the work of kernels."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from statistics import fmean, median
from typing import TYPE_CHECKING

from iprt.measure.camera_motion import Reel, Step
from iprt.measure.cost import Counted, WorkRow
from iprt.measure.cost_report import CostReport
from iprt.measure.intervals import Ratio

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.renderer import Renderer

WARM_UP = 16
"""Untimed frames at the start: one cycle of the tracing grid, after which the mask also knows the
pixels that objects influence."""
COUNTED_FRAMES = 4
"""Frames after the warm-up whose rays and steps are counted. The counts vary little."""
FEWEST_ROUNDS, MOST_ROUNDS = 4, 1000
"""Limits for the number of frames of each of several interleaved reels."""

Progress = Callable[[int], None]
"""Function called with the number of frames done so far, with the warm-up and without a base's
frames."""


@dataclass
class _Run:
    """A playing reel and the measurements of its frames; see `CostReport`."""

    device: ComputeDevice
    renderer: Renderer
    steps: Iterator[Step]
    walls: list[float] = field(default_factory=list)
    hosts: list[float] = field(default_factory=list)
    waits: list[int] = field(default_factory=list)
    traced: list[float] = field(default_factory=list)

    @classmethod
    @contextmanager
    def of(cls, device: ComputeDevice, reel: Reel, count: int) -> Iterator[_Run]:
        """Open the renderer of a reel for `count` frames."""
        with reel.renderer(device) as renderer, reel.steps(device, count) as steps:
            device.finish()
            yield cls(device, renderer, steps)

    def frame(self, *, counts: bool) -> None:
        """Render the next frame; keep its measurements if `counts`."""
        profile = self.device.profile
        start, of_thread, waited = time.perf_counter(), time.thread_time(), profile.waits
        next(self.steps)(self.renderer)
        self.renderer.step()
        host, waited = (time.thread_time() - of_thread) * 1e3, profile.waits - waited
        self.device.wait()
        wall = (time.perf_counter() - start) * 1e3
        profile.finished()
        if counts:
            self.walls.append(wall)
            self.hosts.append(host)
            self.waits.append(waited)
            self.traced += _traced_fraction(self.renderer)

    def report(self, reel: Reel, scene: str, prepare_ms: float) -> CostReport:
        """Build the report of the measured frames."""
        return CostReport.of(
            self.device,
            scene=scene,
            view=reel.view,
            settings=reel.settings,
            prepare_ms=prepare_ms,
            walls=self.walls,
            hosts=self.hosts,
            synchronisations=fmean(self.waits),
            traced=median(self.traced) if self.traced else None,
        )


def timed(
    device: ComputeDevice,
    reel: Reel,
    *,
    scene: str,
    frames: int,
    base: Reel | None = None,
    progress: Progress | None = None,
) -> tuple[CostReport, Ratio | None]:
    """Time `frames` frames of `reel` after a warm-up of `WARM_UP`.

    Parameters
    ----------
    scene : str
        Name for the report.
    base : Reel, optional
        Reel whose frames are interleaved. A slowdown of the machine affects both, so the ratio is
        more reliable than the times.

    Returns
    -------
    report : CostReport
        Report of `reel` alone.
    ratio : Ratio or None
        Wall time of `reel` divided by the wall time of `base`. None without a base.
    """
    profile = device.profile
    count = WARM_UP + frames
    with ExitStack() as stack:
        beside = None if base is None else stack.enter_context(_Run.of(device, base, count))
        profile.reset()
        run = stack.enter_context(_Run.of(device, reel, count))
        prepare_ms = profile.prepared()
        for index in range(count):
            if index == WARM_UP:
                profile.reset()
            if beside is not None:
                profile.recording = False  # until this frame ends
                beside.frame(counts=index >= WARM_UP)
            run.frame(counts=index >= WARM_UP)
            if progress is not None:
                progress(index + 1)
    report = run.report(reel, scene, prepare_ms)
    return report, None if beside is None else Ratio.of(run.walls, beside.walls)


def timed_together(
    device: ComputeDevice, reels: Sequence[Reel], enough: Callable[[int], bool]
) -> list[list[float]]:
    """Time several reels, interleaved frame by frame, after a warm-up.

    Parameters
    ----------
    enough : callable
        Called after each round with the number of rounds after the warm-up. True ends the
        measurement. During the warm-up it takes effect once half the warm-up and `FEWEST_ROUNDS`
        are done.

    Returns
    -------
    list of list of float
        Wall times in ms of each reel's frames, at least `FEWEST_ROUNDS`.
    """
    profile = device.profile
    least = WARM_UP // 2 + FEWEST_ROUNDS
    with ExitStack() as stack:
        runs = [stack.enter_context(_Run.of(device, reel, MOST_ROUNDS)) for reel in reels]
        for done in range(1, MOST_ROUNDS + 1):
            for run in runs:
                profile.recording = False  # until this frame ends
                run.frame(counts=True)
            if enough(max(done - WARM_UP, 0)) and done >= least:
                break
    profile.reset()
    warm_up = min(WARM_UP, done - FEWEST_ROUNDS)
    return [run.walls[warm_up:] for run in runs]


def count_work(device: ComputeDevice, reel: Reel, progress: Progress | None = None) -> Counted:
    """Count the work of kernels per frame, over `COUNTED_FRAMES` after a warm-up of `WARM_UP`."""
    from iprt.device.counting import CountingDevice

    counting = CountingDevice(device)
    count = WARM_UP + COUNTED_FRAMES
    with reel.renderer(counting) as renderer, reel.steps(counting, count) as steps:
        for index in range(count):
            if index == WARM_UP:
                counting.work.clear()
            next(steps)(renderer)
            renderer.step()
            counting.wait()
            counting.profile.reset()
            if progress is not None:
                progress(index + 1)
    return {key: WorkRow.of(work, COUNTED_FRAMES) for key, work in counting.work.items()}


def _traced_fraction(renderer: Renderer) -> list[float]:
    """Return the fraction of traced pixels in a list; empty if no rays relight the real layer."""
    count = None if renderer.method is None else renderer.method.traced_count
    if count is None:
        return []
    view = renderer.view
    # Without the device's `read`, whose transfer the profile would record.
    return [float(count.get()[0]) / (view.width * view.height)]
