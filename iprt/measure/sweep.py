"""Sweeps over settings: speed and accuracy of the same views with many combinations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from iprt.measure.bench import WARM_UP, timed
from iprt.measure.camera_motion import Turn
from iprt.measure.combinations import Combination, still_settings
from iprt.measure.compare import render_target, scored
from iprt.measure.cost_report import CostReport
from iprt.measure.intervals import Ratio
from iprt.measure.measurement import Measurement
from iprt.measure.pareto import pareto_front
from iprt.measure.view_truth import Radiance, ScoreEstimates, Target, with_frames

LEAST_TIMED = 40
"""Least number of timed frames. With fewer, a ratio is accurate to 10% at best."""


@dataclass(frozen=True)
class Outcome:
    """Result of one combination on one view.

    Attributes
    ----------
    bench : CostReport
        Times of a turning view.
    ratio : Ratio or None
        Time relative to the first combination, from interleaved frames. None for the first
        combination.
    ms : float
        Median frame time of the first combination times the ratio, which cancels slowdowns of the
        machine between the runs.
    scores : ScoreEstimates
        Scores of the still picture over seeds.
    """

    view: str
    combination: Combination
    bench: CostReport
    ratio: Ratio | None
    ms: float
    scores: ScoreEstimates


def frames_per_view(combinations: int, frames: int, seeds: int) -> int:
    """Count the frames rendered of one view, without the first combination's beside others."""
    return combinations * (seeds * frames + WARM_UP + max(frames, LEAST_TIMED))


def run_sweep(
    plan: Measurement, frames: int, progress: Callable[[int], None] | None = None
) -> Iterator[tuple[Outcome, Target, Radiance]]:
    """Measure every combination on every view; yield outcomes with the first seed's linear picture.

    Parameters
    ----------
    frames : int
        Number of frames accumulated in each scored picture, and of timed frames, if at least
        `LEAST_TIMED`.
    progress : callable, optional
        Called with the number of frames rendered so far; see `frames_per_view`.

    Raises
    ------
    IprtError
        A picture needs more memory than the device has, or contains NaN.
    """
    done = 0

    def forward(count: int) -> None:
        if progress is not None:
            progress(done + count)

    scene, device = plan.scene, plan.device
    for target, frame in with_frames(scene, plan.targets):
        instances = scene.instances_named(target.objects)
        base: Turn | None = None
        base_ms = 0.0
        for combination in plan.chosen:
            pictures = []
            for seed in range(plan.seeds):
                settings = still_settings(combination.settings, seed)
                drawn = render_target(scene, frame, target, settings, device, frames, forward)
                pictures.append(drawn.color)
                done += frames
            turn = Turn(frame, instances, target.view, combination.settings)
            count = max(frames, LEAST_TIMED)
            bench, ratio = timed(
                device, turn, scene=scene.name, frames=count, base=base, progress=forward
            )
            done += WARM_UP + count
            if ratio is None:
                base, base_ms = turn, bench.wall_ms
            ms = base_ms if ratio is None else base_ms * ratio.value
            scores = [scored(target, color, combination.label) for color in pictures]
            outcome = Outcome(target.name, combination, bench, ratio, ms, ScoreEstimates.of(scores))
            yield outcome, target, pictures[0]


def on_front(outcomes: Sequence[Outcome]) -> list[bool]:
    """Mark the outcomes on the Pareto front of time and accuracy of their view."""
    marks = [False] * len(outcomes)
    for name in dict.fromkeys(outcome.view for outcome in outcomes):
        places = [i for i, outcome in enumerate(outcomes) if outcome.view == name]
        points = [(outcomes[i].ms, -outcomes[i].scores.accuracy) for i in places]
        for place, mark in zip(places, pareto_front(points), strict=True):
            marks[place] = mark
    return marks
