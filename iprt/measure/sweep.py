"""Speed against accuracy: the same views with many combinations of settings."""

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
"""The key of the preset in sweeps; all others are settings."""
MAX_COMBINATIONS = 1000
LEAST_TIMED = 40
"""Frames that are timed at least: a ratio of fewer is known to 10% at best."""


class _BenchArguments(TypedDict):
    """What runs of frames are given."""

    scene: str
    frames: int
    progress: Progress


@dataclass(frozen=True)
class Combination:
    """Settings to measure, and the swept values in them by setting."""

    values: Mapping[str, Any]
    settings: Settings

    @property
    def label(self) -> str:
        """`trace.rays=4, mask.sparse=false`; `base` where nothing was changed."""
        return ", ".join(f"{k}={value_text(v)}" for k, v in self.values.items()) or "base"


@dataclass(frozen=True)
class Outcome:
    """One combination on one view.

    Attributes
    ----------
    bench : CostReport
        Times of a head that turns.
    ratio : Ratio or None
        Of these times to those of the first combination, measured frame by frame beside it; None
        of that itself.
    ms : float
        Median time of a frame of the first combination, times the ratio: what disturbs the machine
        in one of the runs drops out.
    ssim, rmse : Estimate
        Over seeds, of the still picture; see `Scores`.
    flip : Estimate or None
        None where FLIP is not installed.
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
        """The error traded for time: 1 - SSIM, the mean over the cuts, or of a view without any."""
        cuts = [cut.mean for cut in self.ssim_cuts] or [self.ssim.mean]
        return 1.0 - sum(cuts) / len(cuts)

    def record(self) -> dict[str, object]:
        """The same as plain data."""
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
    """The combinations of `sweeps`, texts such as `trace.rays=1,2,4`; all are checked.

    Parameters
    ----------
    quality, given
        What is the same in all, unless it is swept.
    one_at_a_time : bool
        Change one setting at a time, after a combination that changes none; else the product.
    still : bool
        They are for pictures in which nothing moves.

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
    """The assignments that a sweep goes through."""
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
    """A swept value as it was given."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def frames_per_view(combinations: int, frames: int, seeds: int) -> int:
    """Frames rendered of one view: all but the first combination are timed beside that."""
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
    """Measure every combination on every view: outcomes, with the first seed's linear picture.

    Parameters
    ----------
    frames : int
        Frames accumulated in each picture that is scored, and frames timed, if not fewer than
        `LEAST_TIMED`.
    seeds : int
        Pictures per combination and view: with the settings' seed and those after it.
    progress : callable, optional
        Called with the number of frames rendered so far.

    Raises
    ------
    IprtError
        A picture needs more memory than the device has, or holds NaN.
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
    """The settings for a still picture, of the seed that comes `seed` after theirs."""
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
    """Over pictures, for each cut."""
    return tuple(map(Estimate.of, zip(*(score.ssim_cuts for score in scores), strict=True)))


def on_front(outcomes: Sequence[Outcome]) -> list[bool]:
    """Whether no other combination on the same view is both as quick and as accurate."""
    marks = [False] * len(outcomes)
    for name in dict.fromkeys(outcome.target.name for outcome in outcomes):
        places = [i for i, outcome in enumerate(outcomes) if outcome.target.name == name]
        points = [(outcomes[i].ms, outcomes[i].error) for i in places]
        for place, mark in zip(places, pareto_front(points), strict=True):
            marks[place] = mark
    return marks
