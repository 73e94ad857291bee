"""Times per view frame of what a reel shows, and what kernels had to do for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import fmean, median
from typing import TYPE_CHECKING

from iprt.measure.camera_motion import Reel
from iprt.measure.cost import Counted, WorkRow
from iprt.measure.cost_report import CostReport

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.renderer import Renderer

WARM_UP = 16
"""Frames before the first that counts: one cycle of the tracing grid, in which the mask has also
learned where objects have influence."""
COUNTED_FRAMES = 4
"""Frames, after as many warm-ups, whose rays and steps are counted: these vary little."""

Progress = Callable[[int], None]
"""Called with the number of frames done so far, those of the warm-up included."""


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
    walls: list[float] = []
    hosts: list[float] = []
    waits: list[int] = []
    traced: list[float] = []
    count = WARM_UP + frames
    with reel.renderer(device) as renderer, reel.steps(device, count) as steps:
        device.finish()
        prepare_ms = profile.prepared()
        for index in range(count):
            if index == WARM_UP:
                profile.reset()
            start, of_thread, waited = time.perf_counter(), time.thread_time(), profile.waits
            next(steps)(renderer)
            renderer.step()
            host, waited = (time.thread_time() - of_thread) * 1e3, profile.waits - waited
            device.wait()
            wall = (time.perf_counter() - start) * 1e3
            profile.finished()
            if index >= WARM_UP:
                walls.append(wall)
                hosts.append(host)
                waits.append(waited)
                traced += _traced_fraction(renderer)
            if progress is not None:
                progress(index + 1)
    return CostReport.of(
        device,
        scene=scene,
        view=reel.view,
        settings=reel.settings,
        prepare_ms=prepare_ms,
        walls=walls,
        hosts=hosts,
        synchronisations=fmean(waits),
        traced=median(traced) if traced else None,
    )


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
