"""Sweeps over settings: speed and accuracy of the same views with many combinations."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, TypedDict, get_args

from iprt.errors import IprtError
from iprt.measure.bench import WARM_UP, Progress, timed, timed_against
from iprt.measure.camera_motion import Turn
from iprt.measure.compare import render_target, scored
from iprt.measure.cost_report import CostReport
from iprt.measure.intervals import Estimate, Ratio
from iprt.measure.pareto import pareto_front
from iprt.measure.view_truth import Radiance, Scores, Target, with_frames
from iprt.settings.methods import methods
from iprt.settings.model import Settings
from iprt.settings.overrides import Assignment, changed, parse_assignment, resolved
from iprt.settings.presets import STILL, Quality

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.scene.scene import Scene

QUALITY = "quality"
"""Key of the preset in sweeps. All other keys are settings."""
MAX_COMBINATIONS = 1000
LEAST_TIMED = 40
"""Least number of timed frames. With fewer, a ratio is accurate to 10% at best."""


class _BenchArguments(TypedDict):
    """Keyword arguments of `timed` and `timed_against`."""

    scene: str
    frames: int
    progress: Progress


@dataclass(frozen=True)
class Combination:
    """Settings to measure, and their swept values by key."""

    values: Mapping[str, Any]
    settings: Settings

    @property
    def label(self) -> str:
        """Label such as `trace.rays=4, mask.sparse=false`; `base` without swept values."""
        return ", ".join(f"{k}={value_text(v)}" for k, v in self.values.items()) or "base"


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
    ssim, ssim_cuts, rmse : Estimate or tuple of Estimate
        Scores of the still picture over seeds; see `Scores`.
    flip : Estimate or None
        FLIP over seeds. None if FLIP is not installed.
    """

    combination: Combination
    target: Target
    bench: CostReport
    ratio: Ratio | None
    ms: float
    ssim: Estimate
    ssim_cuts: tuple[Estimate, ...]
    rmse: Estimate
    flip: Estimate | None

    @property
    def error(self) -> float:
        """Error of the Pareto front: 1 - SSIM, averaged over the cuts, else of the whole view."""
        cuts = [cut.mean for cut in self.ssim_cuts] or [self.ssim.mean]
        return 1.0 - sum(cuts) / len(cuts)

    def record(self) -> dict[str, object]:
        """Return the outcome as plain data."""
        return {
            **self.bench.record(),
            "view": self.target.name,
            "values": dict(self.combination.values),
            "ratio": None if self.ratio is None else asdict(self.ratio),
            "ms_by_ratio": self.ms,
            "ssim": asdict(self.ssim),
            "ssim_cuts": [asdict(cut) for cut in self.ssim_cuts],
            "rmse": asdict(self.rmse),
            "flip": None if self.flip is None else asdict(self.flip),
            "settings": self.combination.settings.model_dump(mode="json"),
        }


def combinations(
    quality: Quality,
    given: Sequence[Assignment],
    sweeps: Sequence[str],
    *,
    one_at_a_time: bool = False,
    still: bool = True,
) -> list[Combination]:
    """Expand sweeps such as `trace.rays=1,2,4` into combinations and validate them.

    Parameters
    ----------
    quality : str
        Preset of all combinations, unless swept.
    given : sequence of Assignment
        Assignments common to all combinations.
    sweeps : sequence of str
        Sweeps, `KEY=VALUE,VALUE,...`.
    one_at_a_time : bool
        Start with a combination without changes and change one setting at a time. Else form the
        Cartesian product.
    still : bool
        The combinations are for still pictures.

    Raises
    ------
    IprtError
        A value is not allowed, a setting is swept twice, or there are too many combinations.
    """
    axes = [_axis(text, still=still) for text in sweeps]
    keys = [axis[0].key for axis in axes]
    twice = next((key for key in keys if keys.count(key) > 1), None)
    if twice is not None:
        raise IprtError(f"sweep {twice}: is swept twice; give all its values at once")
    count = sum(map(len, axes)) + 1 if one_at_a_time else math.prod(map(len, axes))
    if count > MAX_COMBINATIONS:
        raise IprtError(f"sweep: {count} combinations; at most {MAX_COMBINATIONS} are run")
    if not one_at_a_time:
        return [_combination(quality, given, items) for items in itertools.product(*axes)]
    found = [_combination(quality, given, ())]
    for item in itertools.chain(*axes):
        candidate = _combination(quality, given, (item,))
        if candidate.settings != found[0].settings:
            found.append(candidate)
    return found


def _axis(text: str, *, still: bool) -> list[Assignment]:
    """Parse the assignments of a sweep."""
    key, equals, values = (part.strip() for part in text.partition("="))
    if not equals or not key or not values:
        raise IprtError(f"sweep {text}: expected KEY=VALUE,VALUE,..., such as trace.rays=1,2,4")
    words = [word.strip() for word in values.split(",")]
    if still and key in STILL:
        raise IprtError(
            f"sweep {text}: has no effect on a still picture, which averages all its frames"
        )
    if key == "method" and words == ["all"]:
        words = list(methods())
    if key != QUALITY:
        return [parse_assignment("sweep", f"{key}={word}") for word in words]
    for word in words:
        if word not in get_args(Quality):
            known = ", ".join(get_args(Quality))
            raise IprtError(f"sweep {QUALITY}={word}: expected some of {known}")
    return [Assignment(QUALITY, word, f"sweep {QUALITY}={word}") for word in words]


def _combination(
    quality: Quality, given: Sequence[Assignment], items: Sequence[Assignment]
) -> Combination:
    preset = next((item.value for item in items if item.key == QUALITY), quality)
    swept = [item for item in items if item.key != QUALITY]
    settings = resolved(preset, [*given, *swept])
    return Combination({item.key: item.value for item in items}, settings)


def value_text(value: object) -> str:
    """Format a swept value as on the command line."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def frames_per_view(combinations: int, frames: int, seeds: int) -> int:
    """Count the frames rendered of one view.

    All combinations but the first are timed together with the first one.
    """
    timed_frames = WARM_UP + max(frames, LEAST_TIMED)
    return combinations * seeds * frames + (2 * combinations - 1) * timed_frames


def run_sweep(
    scene: Scene,
    targets: Sequence[Target],
    chosen: Sequence[Combination],
    *,
    device: ComputeDevice,
    frames: int,
    seeds: int,
    progress: Callable[[int], None] | None = None,
) -> Iterator[tuple[Outcome, Radiance]]:
    """Measure every combination on every view; yield outcomes with the first seed's linear picture.

    Parameters
    ----------
    frames : int
        Number of frames accumulated in each scored picture, and of timed frames, if at least
        `LEAST_TIMED`.
    seeds : int
        Number of pictures per combination and view, with consecutive seeds from the settings' seed
        on.
    progress : callable, optional
        Called with the number of frames rendered so far.

    Raises
    ------
    IprtError
        A picture needs more memory than the device has, or contains NaN.
    """
    done = 0

    def forward(count: int) -> None:
        if progress is not None:
            progress(done + count)

    for target, frame in with_frames(scene, targets):
        instances = scene.instances_named(target.objects)
        base = Turn(frame, instances, target.view, chosen[0].settings)
        base_ms = 0.0
        for combination in chosen:
            scores, first = [], None
            for seed in range(seeds):
                settings = still_settings(combination.settings, seed)
                drawn = render_target(scene, frame, target, settings, device, frames, forward)
                color = drawn.color
                scores.append(scored(target, color, combination.label))
                first = color if first is None else first
                done += frames
            assert first is not None
            timed_frames = max(frames, LEAST_TIMED)
            given: _BenchArguments = {
                "scene": scene.name,
                "frames": timed_frames,
                "progress": forward,
            }
            if combination is chosen[0]:
                bench, ratio = timed(device, base, **given), None
                base_ms = bench.wall_ms
                done += WARM_UP + timed_frames
            else:
                turn = Turn(frame, instances, target.view, combination.settings)
                bench, ratio = timed_against(device, base, turn, **given)
                done += 2 * (WARM_UP + timed_frames)
            yield _outcome(combination, target, bench, ratio, base_ms, scores), first


def still_settings(settings: Settings, seed: int) -> Settings:
    """Return the settings for a still picture, with `seed` added to the settings' own seed."""
    return changed(settings, {**STILL, "seed": (settings.seed + seed) % 2**31})


def _outcome(
    combination: Combination,
    target: Target,
    bench: CostReport,
    ratio: Ratio | None,
    base_ms: float,
    scores: Sequence[Scores],
) -> Outcome:
    flips = [score.flip for score in scores if score.flip is not None]
    return Outcome(
        combination=combination,
        target=target,
        bench=bench,
        ratio=ratio,
        ms=base_ms if ratio is None else base_ms * ratio.value,
        ssim=Estimate.of([score.ssim for score in scores]),
        ssim_cuts=cut_estimates(scores),
        rmse=Estimate.of([score.rmse for score in scores]),
        flip=Estimate.of(flips) if flips else None,
    )


def cut_estimates(scores: Sequence[Scores]) -> tuple[Estimate, ...]:
    """Estimate the SSIM of each cut over several pictures."""
    return tuple(map(Estimate.of, zip(*(score.ssim_cuts for score in scores), strict=True)))


def on_front(outcomes: Sequence[Outcome]) -> list[bool]:
    """Mark the outcomes on the Pareto front of time and error of their view."""
    marks = [False] * len(outcomes)
    for name in dict.fromkeys(outcome.target.name for outcome in outcomes):
        places = [i for i, outcome in enumerate(outcomes) if outcome.target.name == name]
        points = [(outcomes[i].ms, outcomes[i].error) for i in places]
        for place, mark in zip(places, pareto_front(points), strict=True):
            marks[place] = mark
    return marks
