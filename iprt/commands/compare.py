"""`iprt compare`: score rendered views against the scene's truth."""

from __future__ import annotations

import json as json_format
import math
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from iprt.commands.compare_video import NO_VIDEO, Video, combinations_of, compare_video
from iprt.commands.flag_types import Size
from iprt.commands.lists import listed
from iprt.commands.measurement_flags import check_count
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.measure.compare import Compared, Comparison
    from iprt.measure.report import Figures
    from iprt.measure.view_truth import Background
    from iprt.output.grid import Grid
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings

NOTHING_ELSE = "nothing else is scored; leave out --method and the flags for videos"
ACCUMULATED = 64
"""Frames accumulated where nothing is said."""


def compare(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    view: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    method: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    pictures: tyro.conf.UseAppendAction[tuple[Path, ...]] = (),
    size: Size = None,
    background: Literal["panorama", "truth"] = "panorama",
    accumulate: int | None = None,
    seed: int | None = None,
    setting_flags: ChosenSettings = BALANCED,
    device: str | None = None,
    json: bool = False,
    fail_under_ssim: float | None = None,
    save: Path | None = None,
    html: Path | None = None,
    video: Video = NO_VIDEO,
    allow_outside: bool = False,
) -> int:
    """Render a scene's views and score them against its path-traced truth.

    Or score pictures that were rendered by other means (--pictures), by the same protocol
    (docs/protocol.md). Images are compared as displayed: exposed, clipped to [0, 1], sRGB-encoded.
    RMSE is of linear radiance. A video is rendered frame by frame, and its flicker is measured too.

    Parameters
    ----------
    scene
        Scene folder.
    view
        Name of a view, or several, separated by commas or with --view again. Default: all views
        that have a truth.
    method
        Relighting methods: names from `iprt methods`, several as with --view, or `all`. Short for
        --set method=. Default: iprt.
    pictures
        Folder of pictures to score by the same protocol: linear EXR files named after the view,
        table.exr, or table.0007.exr for each frame of a video that has a truth. May be given
        several times. Nothing is rendered unless --method is given too.
    size
        Width and height in pixels: the truth's, divided by a whole number. Default: the view's.
    background
        Background behind the objects: the resampled panorama, or the truth's own, which leaves out
        the panorama's limited resolution.
    accumulate
        Frames accumulated into each picture; for a video, into the pictures that --trails compares
        with. Default: 64.
    seed
        Seed of the random numbers; the same seed gives the same picture on the same device.
        Short for --set seed=.
    device
        OpenCL device: gpu, cpu, PLATFORM:DEVICE such as 0:0 (`iprt doctor` lists them), or part of
        a name. Default: $IPRT_DEVICE, or else the fastest.
    json
        Print a JSON list instead of a table.
    fail_under_ssim
        Exit with status 1 if the SSIM of any whole view is lower.
    save
        Folder for one PNG per row: render, truth, and four times their absolute difference; for a
        video, some of its frames.
    html
        HTML page to write: render, truth, difference and FLIP's map of each row, in one file. Not
        for videos.
    video
        Only for videos.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status: 0, or 1 if a score missed `fail_under_ssim` or `fail_over_flicker`.
    """
    if accumulate is not None:
        check_count("--accumulate", accumulate)
    _check_limit(fail_under_ssim)
    if pictures and accumulate is not None and not method:
        raise IprtError(f"--accumulate {accumulate}: has no effect on --pictures without --method")
    if pictures and size is not None:
        raise IprtError(f"--size {size[0]} {size[1]}: pictures of --pictures have their own size")
    if json and video.markdown:
        raise IprtError("--json and --markdown: give one of them")
    video.check()
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.files.atomic import require_writable
    from iprt.files.lock import locked
    from iprt.measure.pictures import compare_pictures
    from iprt.measure.protocol import provenance
    from iprt.measure.view_truth import views_with_truth
    from iprt.scene.scene import Scene

    view, method = listed(view), listed(method)
    asked: list[str | None] = _asked(method)
    for name in asked or [None]:
        setting_flags.resolved(seed=seed, method=name)  # report faults in flags first
    opened = Scene.open(scene, allow_outside=allow_outside)
    moving = len(opened.frame_indices) > 1
    if moving and accumulate is not None and not video.trails:
        raise IprtError(f"--accumulate {accumulate}: has no effect on a video without --trails")
    variants = [
        setting_flags.resolved(opened, still=not moving, seed=seed, method=name)
        for name in asked or [None]
    ]
    views = views_with_truth(opened, view)
    for path in (html, None if save is None else save / "x.png"):
        if path is not None:
            require_writable(path)
            opened.require_not_ours(path)
    if pictures and moving and (method or video != NO_VIDEO):
        raise IprtError(f"--pictures: of a video, {NOTHING_ELSE}")
    made = provenance(opened)
    if moving and not pictures:
        if html is not None:
            raise IprtError(f"--html {html}: is for still pictures; --save shows frames of a video")
        chosen = combinations_of(opened, setting_flags, seed, asked, video)
        compute = ComputeDevice(choose_device(device))
        played = compare_video(
            opened,
            views,
            chosen,
            video,
            compute,
            background,
            accumulate or ACCUMULATED,
            size=size,
            made=made,
            json=json,
            save=save,
        )
        ssim = [scores.ssim for result in played for scores in result.scores.values()]
        return int(_any_below(ssim, fail_under_ssim) or video.missed(played))
    if not moving:
        video.require_none(opened.name)
    rendered = not pictures or bool(method)
    output = Output(f"{opened.name}: compared with its truth", made, save, html)
    with nullcontext() if save is None else locked(save):
        for folder in pictures:
            for compared in compare_pictures(opened, views, folder, background):
                output.add(compared)
        if rendered:
            compute = ComputeDevice(choose_device(device))
            _render(
                opened,
                views,
                variants,
                compute,
                background,
                accumulate or ACCUMULATED,
                size,
                output,
            )
    results = output.results
    if json:
        records = [result.record() for result in results]
        print(json_format.dumps({**made, "results": records}, indent=2))
    else:
        from iprt.output.grid import print_grid

        print_grid(score_grid(results, made))
    return int(_any_below([result.scores.ssim for result in results], fail_under_ssim))


@dataclass
class Output:
    """Writer of comparisons to pictures and a page, one by one, so that no result is lost."""

    title: str
    made: dict[str, Any]
    save: Path | None
    html: Path | None
    results: list[Comparison] = field(default_factory=list)
    figures: list[Figures] = field(default_factory=list)

    def add(self, compared: Compared) -> None:
        """Keep a comparison, and write its pictures and the page."""
        from iprt.measure.report import Report, compared_figures

        self.results.append(compared.comparison)
        if self.save is not None:
            _save(self.save, compared, self.made)
        if self.html is not None:
            self.figures.append(compared_figures(compared))
            grids = [score_grid(self.results, self.made)]
            Report(self.title, grids=grids, figures=self.figures).write(self.html)


def _render(
    scene: Scene,
    views: Sequence[str],
    variants: Sequence[Settings],
    device: ComputeDevice,
    background: Background,
    frames: int,
    size: tuple[int, int] | None,
    output: Output,
) -> None:
    from iprt.commands.progress import progress_bar
    from iprt.measure.compare import compare_views

    before = len(output.results)
    with progress_bar("comparing", len(views) * len(variants) * frames) as progress:
        for compared in compare_views(
            scene,
            views,
            variants,
            device=device,
            background=background,
            frames=frames,
            size=size,
            progress=lambda done: progress((len(output.results) - before) * frames + done),
        ):
            output.add(compared)


def score_grid(results: Sequence[Comparison], made: dict[str, Any]) -> Grid:
    """Return a table with one row per view and method.

    `results` has at least one entry, all over the same background; `made` is their `provenance`.
    """
    from iprt.measure.protocol import provenance_line
    from iprt.output.grid import Grid

    lacking = any(result.scores.flip is None for result in results)
    return Grid(
        title=f"background: {results[0].background}",
        columns=("view", "method", "SSIM", "cuts", "PSNR", "MSE", "RMSE", "FLIP", "ms", "MB"),
        rows=tuple(
            (
                result.view,
                result.method,
                f"{result.scores.ssim:.4f}",
                " ".join(f"{value:.3f}" for value in result.scores.ssim_cuts) or "-",
                f"{result.scores.psnr:.2f}",
                f"{result.scores.mse:.1e}",
                f"{result.scores.rmse:.3g}",
                "-" if result.scores.flip is None else f"{result.scores.flip:.4f}",
                f"{sum(result.ms.values()):.1f}" if result.ms else "-",
                f"{result.bytes / 1e6:.0f}" if result.bytes else "-",
            )
            for result in results
        ),
        notes=(
            *(("FLIP: pip install 'iprt[metrics]'",) if lacking else ()),
            "ms: of a frame, all passes. MB: buffers on the device.",
            provenance_line(made),
        ),
        words=2,
    )


def _any_below(values: Sequence[float], limit: float | None) -> bool:
    return limit is not None and any(value < limit for value in values)


def _asked(names: Sequence[str]) -> list[str | None]:
    """Return names of methods, each once, in the order of `iprt methods`."""
    from iprt.settings.methods import methods

    known = [name for name in methods() if name in names or "all" in names]
    return [*known, *(name for name in names if name != "all" and name not in known)]


def _check_limit(fail_under_ssim: float | None) -> None:
    if fail_under_ssim is not None and not (
        math.isfinite(fail_under_ssim) and -1.0 <= fail_under_ssim <= 1.0
    ):
        raise IprtError(f"--fail-under-ssim {fail_under_ssim}: SSIM lies in [-1, 1]")


def _save(folder: Path, compared: Compared, made: dict[str, Any]) -> None:
    from iprt.measure.compare import DIFFERENCE_GAIN
    from iprt.output.picture import write_display_png

    result = compared.comparison
    write_display_png(
        folder / f"{result.view.replace(' ', '.')}-{result.method}-{result.background}.png",
        compared.panels(),
        metadata={
            "iprt:panels": f"render, truth, absolute difference x{DIFFERENCE_GAIN:g}",
            "iprt:scores": json_format.dumps({**made, **result.record()}),
        },
    )
