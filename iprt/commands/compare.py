"""`iprt compare`: score rendered views against the scene's truth."""

from __future__ import annotations

import json as json_format
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from iprt.errors import IprtError

if TYPE_CHECKING:
    from rich.table import Table

    from iprt.measure.compare import Compared, Comparison


def compare(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    view: str | None = None,
    method: tyro.conf.UseAppendAction[tuple[Literal["iprt", "ibl", "all"], ...]] = (),
    background: Literal["panorama", "truth"] = "panorama",
    frames: int = 64,
    seed: int = 0,
    device: str | None = None,
    json: bool = False,
    fail_under_ssim: float | None = None,
    save: Path | None = None,
) -> int:
    """Render a scene's views and score them against its path-traced truth.

    Images are compared as displayed: exposed, clipped to [0, 1], sRGB-encoded.

    Parameters
    ----------
    scene
        Scene folder.
    view
        Name of one view; without it all views that have a truth.
    method
        How virtual objects are lit; may be given several times. `ibl` is the baseline: a distant
        environment without real geometry. Default: iprt.
    background
        What the camera sees behind the objects: the resampled panorama, or the truth's own
        background, which isolates relighting from the panorama's resolution.
    frames
        Frames accumulated into each picture.
    seed
        Seed of the random numbers; the same seed gives the same picture on the same device.
    device
        gpu, cpu, a place such as 0:0 (see `iprt doctor`), or part of a device's name. Default: the
        fastest kind there is.
    json
        Print a JSON list instead of a table.
    fail_under_ssim
        Exit with status 1 if the SSIM of any whole view is lower.
    save
        Folder for one PNG per row: render, truth, and four times their absolute difference.

    Returns
    -------
    int
        Exit status: 0, or 1 if a score missed `fail_under_ssim`.
    """
    _check_arguments(frames, seed, fail_under_ssim)
    from rich.console import Console

    from iprt.commands.progress import progress_bar
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.measure.compare import METHODS, compare_views, views_with_truth
    from iprt.output.atomic import require_writable
    from iprt.scene.scene import Scene

    opened = Scene.open(scene)
    views = views_with_truth(opened, view)
    asked = method or METHODS[:1]
    methods = [name for name in METHODS if name in asked or "all" in asked]
    if save is not None:
        require_writable(save / "x.png")
    compute = ComputeDevice(choose_device(device))
    results: list[Comparison] = []
    with progress_bar("comparing", len(views) * len(methods) * frames) as progress:
        for compared in compare_views(
            opened,
            views,
            methods,
            device=compute,
            background=background,
            frames=frames,
            seed=seed,
            progress=lambda done: progress(len(results) * frames + done),
        ):
            results.append(compared.comparison)
            if save is not None:
                _save(save, compared)
    if json:
        print(json_format.dumps([result.record() for result in results], indent=2))
    else:
        # A file or pipe has no width to fit in; rich would cut the numbers at 80 columns.
        console = Console() if sys.stdout.isatty() else Console(width=120)
        console.print(score_table(results))
    missed = fail_under_ssim is not None and any(r.ssim < fail_under_ssim for r in results)
    return 1 if missed else 0


def score_table(results: Sequence[Comparison]) -> Table:
    """One row per view and method; at least one result, all over one background."""
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    table = Table(
        title=f"background: {results[0].background}",
        title_justify="left",
        box=SIMPLE_HEAD,
        padding=0,
    )
    for column in ("view", "method"):
        table.add_column(column, no_wrap=True)
    for column in ("SSIM", "cuts", "PSNR", "MSE", "FLIP", "ms/frame"):
        table.add_column(column, justify="right", no_wrap=True)
    for result in results:
        table.add_row(
            result.view,
            result.method,
            f"{result.ssim:.4f}",
            " ".join(f"{score:.3f}" for score in result.ssim_cuts) or "-",
            f"{result.psnr:.2f}",
            f"{result.mse:.1e}",
            "-" if result.flip is None else f"{result.flip:.4f}",
            f"{sum(result.ms.values()):.1f}",
        )
    if any(result.flip is None for result in results):
        table.caption = escape("FLIP: pip install 'iprt[metrics]'")
    return table


def _check_arguments(frames: int, seed: int, fail_under_ssim: float | None) -> None:
    if frames < 1:
        raise IprtError(f"--frames {frames}: at least 1 frame is needed")
    if not 0 <= seed < 2**31:
        raise IprtError(f"--seed {seed}: expected 0 to {2**31 - 1}")
    if fail_under_ssim is not None and not (
        math.isfinite(fail_under_ssim) and -1.0 <= fail_under_ssim <= 1.0
    ):
        raise IprtError(f"--fail-under-ssim {fail_under_ssim}: SSIM lies in [-1, 1]")


def _save(folder: Path, compared: Compared) -> None:
    from iprt.measure.compare import DIFFERENCE_GAIN
    from iprt.output.png import write_display_png

    result = compared.comparison
    write_display_png(
        folder / f"{result.view}-{result.method}-{result.background}.png",
        compared.panels(),
        metadata={
            "iprt:panels": f"render, truth, absolute difference x{DIFFERENCE_GAIN:g}",
            "iprt:scores": json_format.dumps(result.record()),
        },
    )
