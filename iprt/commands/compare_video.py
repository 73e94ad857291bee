"""`iprt compare` for scenes with a video: accuracy and temporal stability."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from iprt.commands.frame_range import frame_range
from iprt.commands.help import plain_default
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.commands.measurement_flags import MeasurementFlags
    from iprt.commands.setting_flags import SettingFlags
    from iprt.measure.combinations import Combination
    from iprt.measure.video_stability import Stability
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
    from iprt.measure.combinations import combinations

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


def play_views(
    scene: Scene,
    views: Sequence[str],
    chosen: Sequence[Combination],
    video: VideoFlags,
    flags: MeasurementFlags,
    converge: int,
    made: dict[str, Any],
    save: Path | None,
) -> Iterator[Stability]:
    """Play the views and yield the measurements.

    Parameters
    ----------
    converge : int
        Frames accumulated in the pictures that trails are measured against.
    made : dict
        The results' `provenance`, for the metadata of pictures.
    save : Path or None
        Folder for film strips.
    """
    from iprt.commands.progress import progress_bar
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.measure.film_strip import FilmStrip
    from iprt.measure.video_stability import Player, resized

    indices = video.indices(scene)
    device = ComputeDevice(choose_device(flags.device))
    with progress_bar("playing", len(views) * len(indices)) as progress:
        for number, name in enumerate(views):
            view = resized(scene.views[name], flags.size)
            player = Player(
                scene,
                view,
                chosen,
                device=device,
                background=flags.background,
                converge=converge if video.trails else 0,
            )
            strips = [FilmStrip(indices, view.cuts) for _ in chosen]
            for done, moment in enumerate(player.play(indices), start=1):
                for strip, shown in zip(strips, moment.shown, strict=True):
                    strip.add(moment.index, shown, moment.converged)
                progress(number * len(indices) + done)
            for result, strip in zip(player.results(), strips, strict=True):
                if save is not None:
                    # Settings may contain slashes.
                    file = f"{result.view}-{result.settings}".replace("/", "_").replace(", ", "+")
                    strip.write(save / f"{file}.png", {**made, **vars(result)})
                yield result
