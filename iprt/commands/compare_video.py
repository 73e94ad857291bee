"""`iprt compare` for scenes with a video: accuracy and temporal stability."""

from __future__ import annotations

import json as json_format
import math
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from iprt.commands.frames import frame_range
from iprt.commands.help import plain_default
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.commands.setting_flags import SettingFlags
    from iprt.device.compute import ComputeDevice
    from iprt.measure.stability import Flicker
    from iprt.measure.sweep import Combination
    from iprt.measure.video import Stability
    from iprt.measure.view_truth import Background
    from iprt.output.grid import Grid
    from iprt.scene.scene import Scene


@dataclass(frozen=True)
class VideoFlags:
    """Options of videos, which still pictures do not take."""

    frames: Annotated[str | None, plain_default("FIRST:LAST")] = None
    """Frames of the video to play, with both ends, numbered as in scene.toml. Default: all."""
    trails: Annotated[bool, plain_default()] = False
    """Measure ghosting: for how long things that have moved away stay visible."""
    sweep: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], plain_default("KEY=VALUES")] = ()
    """Values of a setting to compare, such as trace.rays=1,2; several: all combinations."""
    one_at_a_time: Annotated[bool, plain_default()] = False
    """With --sweep: change one setting at a time, instead of all combinations."""
    fail_over_flicker: Annotated[float | None, plain_default("X")] = None
    """Exit with status 1 if pixels without objects flicker more than X times the input."""
    markdown: Annotated[bool, plain_default()] = False
    """Print a Markdown table."""

    def require_none(self, name: str) -> None:
        """Raise an error if any flag is given, for the scene `name` with a single frame.

        Raises
        ------
        IprtError
        """
        for field, default in vars(VideoFlags()).items():
            if getattr(self, field) != default:
                flag = field.replace("_", "-")
                raise IprtError(f"--{flag}: is for videos; {name} has a single frame")

    def check(self) -> None:
        """Raise an error if a value is not allowed, or a flag has no effect.

        Raises
        ------
        IprtError
        """
        limit = self.fail_over_flicker
        if limit is not None and not (math.isfinite(limit) and limit >= 0.0):
            raise IprtError(f"--fail-over-flicker {limit:g}: expected a factor, such as 1.3")
        if self.one_at_a_time and not self.sweep:
            raise IprtError("--one-at-a-time: is for --sweep")

    def indices(self, scene: Scene) -> range:
        """Return the frames to play, without gaps.

        Raises
        ------
        IprtError
            There are no such frames, or the range has gaps.
        """
        indices = frame_range(self.frames, scene.frame_indices)
        if indices.step != 1 and len(indices) > 1:
            raise IprtError(f"--frames {self.frames}: a video is played without gaps")
        return indices

    def missed(self, results: Sequence[Stability]) -> bool:
        """Return whether real pixels flicker more than `fail_over_flicker` allows."""
        limit = self.fail_over_flicker
        return limit is not None and any(result.worst_flicker > limit for result in results)


Video = tyro.conf.OmitArgPrefixes[VideoFlags]
NO_VIDEO = VideoFlags()


def combinations_of(
    scene: Scene,
    setting_flags: SettingFlags,
    seed: int | None,
    methods: Sequence[str | None],
    flags: VideoFlags,
) -> list[Combination]:
    """Return the combinations of settings to play the video with: of methods and swept settings.

    Raises
    ------
    IprtError
        A value is not allowed, or given twice.
    """
    from iprt.measure.sweep import combinations

    several = [f"method={','.join(map(str, methods))}"] if len(methods) > 1 else []
    return combinations(
        setting_flags.quality,
        setting_flags.assignments(
            scene, seed=seed, method=methods[0] if len(methods) == 1 else None
        ),
        [*several, *flags.sweep],
        one_at_a_time=flags.one_at_a_time,
        still=False,
    )


def compare_video(
    scene: Scene,
    views: Sequence[str],
    chosen: Sequence[Combination],
    flags: VideoFlags,
    device: ComputeDevice,
    background: Background,
    frames: int,
    *,
    size: tuple[int, int] | None,
    made: dict[str, Any],
    json: bool,
    save: Path | None,
) -> list[Stability]:
    """Play the views, print the measurements, and return them; `made` is their `provenance`."""
    from iprt.commands.progress import progress_bar
    from iprt.files.lock import locked
    from iprt.measure.film_strip import Strip
    from iprt.measure.video import Player, resized

    indices = flags.indices(scene)
    results: list[Stability] = []
    with (
        nullcontext() if save is None else locked(save),
        progress_bar("playing", len(views) * len(indices)) as progress,
    ):
        for number, name in enumerate(views):
            view = resized(scene.views[name], size)
            player = Player(
                scene,
                view,
                chosen,
                device=device,
                background=background,
                converge=frames if flags.trails else 0,
            )
            strips = [Strip(indices, view.cuts) for _ in chosen]
            for done, moment in enumerate(player.play(indices), start=1):
                for strip, shown in zip(strips, moment.shown, strict=True):
                    strip.add(moment.index, shown, moment.converged)
                progress(number * len(indices) + done)
            found = player.results()
            results += found
            if save is not None:
                for result, strip in zip(found, strips, strict=True):
                    record = {**made, **result.record()}
                    strip.write(save / f"{_file_name(result)}.png", record)
    if json:
        records = [result.record() for result in results]
        print(json_format.dumps({**made, "results": records}, indent=2))
    else:
        from iprt.output.grid import print_grid

        print_grid(stability_grid(results, background, made), markdown=flags.markdown)
    return results


def _file_name(result: Stability) -> str:
    """Return a file name without suffix; labels may contain slashes."""
    return f"{result.view}-{result.label}".replace("/", "_").replace(", ", "+")


def stability_grid(results: Sequence[Stability], background: str, made: dict[str, Any]) -> Grid:
    """Return a table with one row per view and settings.

    `results` has at least one entry; `made` is their `provenance`.
    """
    from iprt.measure.protocol import provenance_line
    from iprt.output.grid import Grid

    trails = any(result.trails for result in results)
    columns = ["view", "settings", "SSIM", "cuts", "change", "untouched", "relit", "object"]
    columns += ["relit/truth", "object/truth"]
    columns += ["trail", f"ghost at {GHOST_AGE}"] if trails else []
    return Grid(
        title=f"video; background: {background}",
        columns=tuple(columns),
        rows=tuple(tuple(_row(result, trails=trails)) for result in results),
        notes=(*(NOTES if trails else NOTES[:-1]), provenance_line(made)),
        words=2,
    )


GHOST_AGE = 4
"""Frames after something has left, at which tables say how much of it is still seen."""
NOTES = (
    "SSIM, cuts: means over the frames with a truth. change: RMSE of the change from frame to "
    "frame against the truth's, in 1/255.",
    "untouched, relit, object: flicker, the mean absolute difference of consecutive pictures after "
    "motion compensation, in 1/255; x: over the input's, or the truth's, on the same pixels.",
    "trail: frames until moved objects, real things and shadows change the picture "
    f"by less than 1/255; ghost: the share of it still visible {GHOST_AGE} frames later.",
)


def _row(result: Stability, *, trails: bool) -> Iterator[str]:
    yield result.view
    yield result.label
    yield _number(result.mean(lambda scores: scores.ssim), 4)
    cuts = zip(*(scores.ssim_cuts for scores in result.scores.values()), strict=True)
    yield " ".join(f"{fmean(cut):.3f}" for cut in cuts) or "-"
    change = result.temporal_error
    yield _number(None if change is None else 255.0 * change, 2)
    equal = "" if result.unequal == 0 else f" ({result.unequal} pixels differ)"
    yield _flicker(result.flicker["untouched"]) + equal
    yield _flicker(result.flicker["relit"])
    yield _number(255.0 * result.flicker["object"].output, 2)
    yield _flicker(result.true_flicker["relit"])
    yield _flicker(result.true_flicker["object"])
    if trails:
        from iprt.measure.stability import CAUSES

        found = [result.trails[cause] for cause in CAUSES]
        yield ", ".join("-" if trail.frames is None else str(trail.frames) for trail in found)
        ages = [trail.ages[min(GHOST_AGE, len(trail.ages) - 1)] for trail in found]
        yield ", ".join(f"{round(100.0 * age.ghost)}%" if age.known else "-" for age in ages)


def _flicker(flicker: Flicker) -> str:
    if flicker.pixels == 0:
        return "-"
    return f"{255.0 * flicker.output:.2f} ({flicker.ratio:.2f}x)"


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None or math.isnan(value) else f"{value:.{digits}f}"
