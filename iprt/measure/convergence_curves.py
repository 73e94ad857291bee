"""Convergence of a still picture: accuracy against rendering time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from iprt.errors import IprtError
from iprt.measure.compare import scored
from iprt.measure.intervals import Estimate
from iprt.measure.measurement import Measurement
from iprt.measure.timed_renderers import timed_iprt
from iprt.measure.view_truth import ScoreEstimates, Scores

MAX_COUNT = 2**16


@dataclass(frozen=True)
class Point:
    """Time and accuracy after a number of frames.

    Attributes
    ----------
    count : int
        Accumulated frames, or samples per pixel of a path tracer.
    seconds : Estimate
        Time from the scene in memory to the picture; see `TimedRenderer.picture`.
    scores : ScoreEstimates
    """

    count: int
    seconds: Estimate
    scores: ScoreEstimates


@dataclass(frozen=True)
class Curve:
    """Convergence of one view with one combination of settings, in order of time."""

    view: str
    label: str
    points: tuple[Point, ...]

    @property
    def cuts(self) -> list[str]:
        """Names of the view's cuts, such as `cut 1`, or `whole view` if it has none."""
        count = len(self.points[0].scores.ssim_cuts)
        return [f"cut {number}" for number in range(1, count + 1)] or ["whole view"]

    def best(self, cut: int) -> float:
        """Return the highest SSIM of the cut with an index in `cuts`."""
        return max(point.scores.cuts[cut].mean for point in self.points)


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
    plan: Measurement, counts: Sequence[int], progress: Callable[[int], None] | None = None
) -> Iterator[Curve]:
    """Measure a curve per view and combination of settings.

    Parameters
    ----------
    counts : sequence of int
        Numbers of frames after which the picture is scored, rising.
    progress : callable, optional
        Called with the number of frames rendered so far.
    """
    done = 0
    for target, combination, renderer in timed_iprt(plan):
        runs = []
        for seed in range(plan.seeds):
            pictures = []
            for count in counts:
                seconds, color = renderer.picture(count, seed)
                pictures.append((seconds, scored(target, color, combination.label)))
                if progress is not None:
                    progress(done + count)
            runs.append(pictures)
            done += counts[-1]
        yield curve(target.name, combination.label, counts, runs)


def curve(
    view: str, label: str, counts: Sequence[int], runs: Sequence[Sequence[tuple[float, Scores]]]
) -> Curve:
    """Average runs, each of which has (seconds, scores) per count."""
    points = []
    for count, at in zip(counts, zip(*runs, strict=True), strict=True):
        seconds, scores = zip(*at, strict=True)
        points.append(Point(count, Estimate.of(seconds), ScoreEstimates.of(scores)))
    return Curve(view, label, tuple(points))


def seconds_to(curve: Curve, cut: int, ssim: float) -> float | None:
    """Return the seconds after which a cut first reaches an SSIM; None if it never does.

    Between two pictures, SSIM is interpolated linearly in the logarithm of time.
    """
    before: tuple[float, float] | None = None
    for seconds, high in sorted((p.seconds.mean, p.scores.cuts[cut].mean) for p in curve.points):
        if high >= ssim:
            if before is None:
                return seconds
            time, low = before
            share = (ssim - low) / (high - low)
            return math.exp((1.0 - share) * math.log(time) + share * math.log(seconds))
        before = seconds, high
    return None
