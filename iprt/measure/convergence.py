"""Accuracy against time: how a still picture gets better the longer it is rendered."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from iprt.errors import IprtError
from iprt.measure.compare import scored
from iprt.measure.intervals import Estimate
from iprt.measure.sweep import Combination, cut_estimates, still_settings
from iprt.measure.view_truth import Radiance, Scores, Target, with_frames

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings

MAX_COUNT = 2**16


@dataclass(frozen=True)
class Point:
    """A picture on the way.

    Attributes
    ----------
    count : int
        Frames accumulated, or samples per pixel of a path tracer.
    seconds : Estimate
        From what is in memory to the picture: preparation and all frames so far, without
        compiling kernels.
    """

    count: int
    seconds: Estimate
    ssim: Estimate
    ssim_cuts: tuple[Estimate, ...]

    def reached(self, cut: int | None) -> float:
        """Mean SSIM of a cut, or of the whole view."""
        return self.ssim.mean if cut is None else self.ssim_cuts[cut].mean


@dataclass(frozen=True)
class Curve:
    """Pictures of one view in the order in which they were reached."""

    view: str
    label: str
    points: tuple[Point, ...]

    def record(self) -> dict[str, object]:
        """The same as plain data."""
        return asdict(self)


def parse_counts(text: str) -> list[int]:
    """Whole numbers that rise, `1,2,4`; after `...` doubling goes on to the last: `1,2,...,64`.

    Raises
    ------
    IprtError
        `text` is no such list.
    """
    words = [word.strip() for word in text.split(",")]
    try:
        if "..." in words:
            place = words.index("...")
            start = [int(word) for word in words[:place]]
            (last,) = (int(word) for word in words[place + 1 :])
            while start[-1] > 0 and 2 * start[-1] < last <= MAX_COUNT:
                start.append(2 * start[-1])
            counts = [*start, last]
        else:
            counts = [int(word) for word in words]
        rising = all(a < b for a, b in itertools.pairwise([0, *counts]))
        if not rising or counts[-1] > MAX_COUNT:
            raise ValueError
    except (ValueError, IndexError):
        raise IprtError(
            f"--accumulate {text}: expected rising numbers from 1 to {MAX_COUNT}, such as "
            "1,2,4,8 or 1,2,...,256"
        ) from None
    return counts


def run_convergence(
    scene: Scene,
    targets: Sequence[Target],
    chosen: Sequence[Combination],
    counts: Sequence[int],
    *,
    device: ComputeDevice,
    seeds: int,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Curve]:
    """A curve per view and combination of settings.

    Parameters
    ----------
    counts : sequence of int
        Frames after which the picture is scored, rising.
    seeds : int
        Runs that scores and times are the means of: the settings' seed and those after it.
    progress : callable, optional
        Called with the number of frames rendered so far.
    """
    done = 0

    def forward(count: int) -> None:
        if progress is not None:
            progress(done + count)

    for target, frame in with_frames(scene, targets):
        for combination in chosen:
            # Drivers compile when a kernel first runs, which must not count.
            _pictures(scene, frame, target, still_settings(combination.settings, 0), [1], device)
            runs = []
            for seed in range(seeds):
                settings = still_settings(combination.settings, seed)
                pictures = _pictures(scene, frame, target, settings, counts, device, forward)
                runs.append(
                    [(spent, scored(target, color, combination.label)) for spent, color in pictures]
                )
                done += counts[-1]
            yield curve(target.name, combination.label, counts, runs)


def curve(
    view: str, label: str, counts: Sequence[int], runs: Sequence[Sequence[tuple[float, Scores]]]
) -> Curve:
    """The means over runs, each with (seconds, scores) per count."""
    points = []
    for count, at in zip(counts, zip(*runs, strict=True), strict=True):
        scores = [score for _, score in at]
        points.append(
            Point(
                count=count,
                seconds=Estimate.of([seconds for seconds, _ in at]),
                ssim=Estimate.of([score.ssim for score in scores]),
                ssim_cuts=cut_estimates(scores),
            )
        )
    return Curve(view, label, tuple(points))


def _pictures(
    scene: Scene,
    frame: Frame,
    target: Target,
    settings: Settings,
    counts: Sequence[int],
    device: ComputeDevice,
    progress: Callable[[int], None] | None = None,
) -> list[tuple[float, Radiance]]:
    """(seconds, linear picture) after each count of frames; scoring is left for later."""
    from iprt.memory import require_memory
    from iprt.renderer import Renderer

    instances = scene.instances_named(target.objects)
    require_memory(device, frame, instances, target.view, settings)
    profile = device.profile
    compiled = profile.compile_ms
    pictures = []
    start = time.perf_counter()
    with Renderer(
        device, frame, instances, target.view, settings, background=target.background
    ) as renderer:
        done = 0
        for count in counts:
            color = renderer.render(count - done).color
            done = count
            elapsed = time.perf_counter() - start - (profile.compile_ms - compiled) * 1e-3
            pictures.append((elapsed, color))
            profile.reset()  # else the events of all frames are kept
            if progress is not None:
                progress(done)
    return pictures


def seconds_to(points: Sequence[Point], cut: int | None, ssim: float) -> float | None:
    """The least seconds after which a curve has an SSIM; None if it never has.

    Between two pictures SSIM is taken as linear in the logarithm of time.
    """
    before: Point | None = None
    for point in sorted(points, key=lambda point: point.seconds.mean):
        high = point.reached(cut)
        if high >= ssim:
            if before is None:
                return point.seconds.mean
            low = before.reached(cut)
            share = (ssim - low) / (high - low)
            times = math.log(before.seconds.mean), math.log(point.seconds.mean)
            return math.exp(times[0] + share * (times[1] - times[0]))
        before = point
    return None
