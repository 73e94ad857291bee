"""Times per view frame of what a reel shows, and what kernels had to do for it."""

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
"""Frames before the first that counts: one cycle of the tracing grid, in which the mask has also
learned where objects have influence."""
COUNTED_FRAMES = 4
"""Frames, after as many warm-ups, whose rays and steps are counted: these vary little."""
FEWEST_ROUNDS, MOST_ROUNDS = 4, 1000
"""Frames of each of several reels that take turns."""

Progress = Callable[[int], None]
"""Called with the number of frames done so far, those of the warm-up included."""


@dataclass
class _Run:
    """A reel that is shown, and what its frames took: see `CostReport`."""

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
        with reel.renderer(device) as renderer, reel.steps(device, count) as steps:
            device.finish()
            yield cls(device, renderer, steps)

    def frame(self, *, counts: bool) -> None:
        """Show the next frame; the first ones do not count."""
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
    progress: Progress | None = None,
) -> CostReport:
    """Time `frames` frames of `reel`, of the scene of that name, after `WARM_UP` others."""
    profile = device.profile
    profile.reset()
    count = WARM_UP + frames
    with _Run.of(device, reel, count) as run:
        prepare_ms = profile.prepared()
        for index in range(count):
            if index == WARM_UP:
                profile.reset()
            run.frame(counts=index >= WARM_UP)
            if progress is not None:
                progress(index + 1)
    return run.report(reel, scene, prepare_ms)


def timed_against(
    device: ComputeDevice,
    base: Reel,
    reel: Reel,
    *,
    scene: str,
    frames: int,
    progress: Progress | None = None,
) -> tuple[CostReport, Ratio]:
    """Time `reel` as `timed` does, each of its frames after one of `base`.

    What slows the machine down slows both, so that their ratio holds where times do not.

    Returns
    -------
    report : CostReport
        Of `reel` alone.
    ratio : Ratio
        Of the wall times of `reel` to those of `base`.
    """
    profile = device.profile
    profile.reset()
    count = WARM_UP + frames
    with _Run.of(device, base, count) as beside:
        profile.reset()
        with _Run.of(device, reel, count) as run:
            prepare_ms = profile.prepared()
            for index in range(count):
                if index == WARM_UP:
                    profile.reset()
                profile.recording = False  # until this frame ends
                beside.frame(counts=index >= WARM_UP)
                run.frame(counts=index >= WARM_UP)
                if progress is not None:
                    progress(2 * (index + 1))
    return run.report(reel, scene, prepare_ms), Ratio.of(run.walls, beside.walls)


def timed_together(
    device: ComputeDevice, reels: Sequence[Reel], enough: Callable[[int], bool]
) -> list[list[float]]:
    """Milliseconds of frames of several reels, which take turns frame by frame after a warm-up.

    Parameters
    ----------
    enough : callable
        Called after each round with the number of those that count; True ends it, even in the
        warm-up, where there are half of that and `FEWEST_ROUNDS`.

    Returns
    -------
    list of list of float
        Per reel the wall times of its frames, at least `FEWEST_ROUNDS`.
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
    """Work of kernels per frame, in the `COUNTED_FRAMES` after `WARM_UP` others."""
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
    """The fraction, in a list; an empty list where no rays relight the real layer."""
    count = None if renderer.method is None else renderer.method.traced_count
    if count is None:
        return []
    view = renderer.view
    # Not by the device: this is no part of a frame.
    return [float(count.get()[0]) / (view.width * view.height)]
