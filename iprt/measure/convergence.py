"""Convergence of a still picture: accuracy against rendering time."""

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
    """Time and accuracy after a number of frames.

    Attributes
    ----------
    count : int
        Accumulated frames, or samples per pixel of a path tracer.
    seconds : Estimate
        Time from the loaded scene to the picture: preparation and all frames so far, without
        compiling kernels.
    ssim, ssim_cuts : Estimate, tuple of Estimate
        SSIM of the view, and of each cut.
    """

    count: int
    seconds: Estimate
    ssim: Estimate
    ssim_cuts: tuple[Estimate, ...]

    def reached(self, cut: int | None) -> float:
        """Return the mean SSIM of a cut, or of the whole view for None."""
        return self.ssim.mean if cut is None else self.ssim_cuts[cut].mean


@dataclass(frozen=True)
class Curve:
    """Convergence of one view with one combination of settings, in order of time."""

    view: str
    label: str
    points: tuple[Point, ...]

    def record(self) -> dict[str, object]:
        """Return the curve as plain data."""
        return asdict(self)


def parse_counts(text: str) -> list[int]:
    """Parse a list of rising integers such as `1,2,4`. `1,2,...,64` continues by doubling.

    Raises
    ------
    IprtError
        `text` is not such a list.
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
    """Measure a curve per view and combination of settings.

    Parameters
    ----------
    counts : sequence of int
        Numbers of frames after which the picture is scored, rising.
    seeds : int
        Number of runs to average, with consecutive seeds from the settings' seed on.
    progress : callable, optional
        Called with the number of frames rendered so far.
    """
    done = 0

    def forward(count: int) -> None:
        if progress is not None:
            progress(done + count)

    for target, frame in with_frames(scene, targets):
        for combination in chosen:
            # Drivers compile when a kernel first runs; do this before the clock starts.
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
    """Average runs, each of which has (seconds, scores) per count."""
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
    """Render (seconds, linear picture) after each count of frames, without scoring."""
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
            profile.reset()  # else it would keep the events of all frames
            if progress is not None:
                progress(done)
    return pictures


def seconds_to(points: Sequence[Point], cut: int | None, ssim: float) -> float | None:
    """Return the seconds after which a curve first reaches an SSIM; None if it never does.

    Between two pictures, SSIM is interpolated linearly in the logarithm of time.
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
