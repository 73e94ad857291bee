"""`iprt compare`: score rendered views against the scene's truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from iprt.commands.compare_video import NO_VIDEO, Video, combinations_of, play_views
from iprt.commands.flag_types import listed
from iprt.commands.measurement_flags import Measured, MeasurementFlags, check_count
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.measure.compare import Compared
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings

NOTHING_ELSE = "nothing else is scored; leave out --method and the flags for videos"
ACCUMULATED = 64
"""Default number of accumulated frames."""
OVER_PANORAMA = MeasurementFlags(background="panorama")


def compare(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    method: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    pictures: tyro.conf.UseAppendAction[tuple[Path, ...]] = (),
    accumulate: int | None = None,
    seed: int | None = None,
    fail_under_ssim: float | None = None,
    save: Path | None = None,
    measurement_flags: Measured = OVER_PANORAMA,
    setting_flags: ChosenSettings = BALANCED,
    video: Video = NO_VIDEO,
) -> int:
    """Render a scene's views and score them against its path-traced truth.

    Or score pictures that were rendered by other means (--pictures), by the same protocol
    (docs/protocol.md). Images are compared as displayed: exposed, clipped to [0, 1], sRGB-encoded.
    RMSE is of linear radiance. A video is rendered frame by frame, and its flicker is measured too.

    Parameters
    ----------
    scene
        Scene folder.
    method
        Relighting methods: names from `iprt methods`, several as with --view, or `all`. Short for
        --set method=. Default: iprt.
    pictures
        Folder of pictures to score by the same protocol: linear EXR files named after the view,
        table.exr, or table.0007.exr for each frame of a video that has a truth. May be given
        several times. Nothing is rendered unless --method is given too.
    accumulate
        Frames accumulated into each picture; for a video, into the pictures that --trails compares
        with. Default: 64.
    seed
        Seed of the random numbers; the same seed gives the same picture on the same device.
        Short for --set seed=.
    fail_under_ssim
        Exit with status 1 if the SSIM of any whole view is lower.
    save
        Folder for one PNG per row: render, truth, and four times their absolute difference; for a
        video, some of its frames.
    video
        Only for videos.

    Returns
    -------
    int
        Exit status: 0, or 1 if a score missed `fail_under_ssim` or `fail_over_flicker`.
    """
    if accumulate is not None:
        check_count("--accumulate", accumulate)
    if fail_under_ssim is not None and not -1.0 <= fail_under_ssim <= 1.0:
        raise IprtError(f"--fail-under-ssim {fail_under_ssim}: SSIM lies in [-1, 1]")
    method, size = listed(method), measurement_flags.size
    if pictures and accumulate is not None and not method:
        raise IprtError(f"--accumulate {accumulate}: has no effect on --pictures without --method")
    if pictures and size is not None:
        raise IprtError(f"--size {size[0]} {size[1]}: pictures of --pictures have their own size")
    video.check()
    from iprt.files.atomic import require_writable
    from iprt.files.lock import locked
    from iprt.measure.compare import score_grid
    from iprt.measure.protocol import provenance, provenance_line
    from iprt.measure.report import Report, compared_figures
    from iprt.measure.stability_report import stability_grid
    from iprt.measure.view_truth import views_with_truth

    asked = _asked(method) or [None]
    for name in asked:
        setting_flags.resolved(seed=seed, method=name)  # report faults in flags first
    opened = measurement_flags.open(scene)
    moving = len(opened.frame_indices) > 1
    if moving and accumulate is not None and not video.trails:
        raise IprtError(f"--accumulate {accumulate}: has no effect on a video without --trails")
    variants = [
        setting_flags.resolved(opened, still=not moving, seed=seed, method=name) for name in asked
    ]
    views = views_with_truth(opened, listed(measurement_flags.view))
    if save is not None:
        require_writable(save / "x.png")
        opened.require_not_ours(save / "x.png")
    if pictures and moving and (method or video != NO_VIDEO):
        raise IprtError(f"--pictures: of a video, {NOTHING_ELSE}")
    flags, frames, made = measurement_flags, accumulate or ACCUMULATED, provenance(opened)
    with nullcontext() if save is None else locked(save):
        if moving and not pictures:
            if flags.html is not None:
                raise IprtError(
                    f"--html {flags.html}: is for stills; --save shows frames of a video"
                )
            chosen = combinations_of(opened, setting_flags, seed, asked, video)
            films = play_views(opened, views, chosen, video, flags, frames, made, save)
            played = flags.output.collect(
                ((film, tuple) for film in films),
                "results",
                made,
                lambda done: Report("", grids=[stability_grid(done, flags.background)]),
            )
            ssim = [scores.ssim for film in played for scores in film.scores.values()]
            return int(_any_below(ssim, fail_under_ssim) or video.missed(played))
        if not moving:
            video.require_none(opened.name)
        rendered = variants if method or not pictures else []
        found = _compared(opened, views, pictures, rendered, flags, frames)
        title = f"{opened.name}: compared with its truth"
        results = flags.output.collect(
            ((one.comparison, partial(compared_figures, one)) for one in _saved(found, save, made)),
            "results",
            made,
            lambda done: Report(title, [provenance_line(made)], [score_grid(done)]),
        )
    return int(_any_below([result.scores.ssim for result in results], fail_under_ssim))


def _compared(
    scene: Scene,
    views: Sequence[str],
    pictures: Sequence[Path],
    variants: Sequence[Settings],
    flags: MeasurementFlags,
    frames: int,
) -> Iterator[Compared]:
    """Score the pictures of folders, then rendered ones."""
    from iprt.commands.progress import progress_bar
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.measure.compare import compare_views
    from iprt.measure.pictures import compare_pictures

    for folder in pictures:
        yield from compare_pictures(scene, views, folder, flags.background)
    if not variants:
        return
    device = ComputeDevice(choose_device(flags.device))
    with progress_bar("comparing", len(views) * len(variants) * frames) as progress:
        yield from compare_views(
            scene,
            views,
            variants,
            device=device,
            background=flags.background,
            frames=frames,
            size=flags.size,
            progress=progress,
        )


def _saved(
    compared: Iterator[Compared], folder: Path | None, made: dict[str, Any]
) -> Iterator[Compared]:
    """Yield comparisons whose panels have been written to `folder`, if there is one."""
    from iprt.measure.compare import DIFFERENCE_GAIN
    from iprt.measure.results import json_text
    from iprt.output.picture import write_display_png

    for one in compared:
        if folder is not None:
            result = one.comparison
            name = f"{result.view.replace(' ', '.')}-{result.method}-{result.background}.png"
            write_display_png(
                folder / name,
                one.panels(),
                metadata={
                    "iprt:panels": f"render, truth, absolute difference x{DIFFERENCE_GAIN:g}",
                    "iprt:scores": json_text({**made, **vars(result)}),
                },
            )
        yield one


def _any_below(values: Sequence[float], limit: float | None) -> bool:
    return limit is not None and any(value < limit for value in values)


def _asked(names: Sequence[str]) -> list[str | None]:
    """Return names of methods, each once, in the order of `iprt methods`."""
    from iprt.settings.methods import methods

    known = [name for name in methods() if name in names or "all" in names]
    return [*known, *(name for name in names if name != "all" and name not in known)]
