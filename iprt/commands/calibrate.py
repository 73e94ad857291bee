"""`iprt calibrate`: table of the settings' cost on this device, for `render` and `view`."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from iprt.commands.flag_types import listed
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.measure.tradeoff import Tradeoff
    from iprt.measure.tradeoff_cache import TimedDevice
    from iprt.measure.view_truth import Target
    from iprt.scene.scene import Scene

ROOM = Path("scenes360/room")
MOST_VIEWS = 2
"""Views that are timed, so that all of them have time enough."""

LOG = logging.getLogger("iprt.measure")


def calibrate(
    scene: tyro.conf.Positional[Path] = ROOM,
    /,
    *,
    view: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    ssim: bool = False,
    output: Annotated[Path | None, tyro.conf.arg(aliases=("-o",))] = None,
    device: str | None = None,
    json: bool = False,
    markdown: bool = False,
    allow_outside: bool = False,
) -> int:
    """Time a range of settings on this device, in about two minutes, and keep the table.

    `iprt render` chooses among these settings for --time-per-frame and --ssim, and `iprt view`
    to hold --fps. The table is kept in the cache folder, for this device, its driver and this
    version of iprt. Without it, both use the table that comes with iprt, measured on another
    device.

    Parameters
    ----------
    scene
        Scene folder whose views are timed; the estimates hold for similar scenes.
    view
        Name of a view to time, or several, separated by commas or with --view again. Default: the
        first two that have a truth, or else the first two.
    ssim
        Measure the accuracy too, on the views that have a truth, which takes some more minutes.
        Accuracy hardly depends on the device: by default, the SSIM of iprt's own table is kept.
    output
        TOML file to write the table to, in place of the one in the cache folder.
    device
        OpenCL device: gpu, cpu, PLATFORM:DEVICE such as 0:0 (`iprt doctor` lists them), or part of
        a name. Default: $IPRT_DEVICE, or else the fastest.
    json
        Print a JSON object instead of a table.
    markdown
        Print a Markdown table.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.commands.standard_streams import reporting
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.files.atomic import require_writable
    from iprt.measure.tradeoff_cache import TimedDevice, keep
    from iprt.measure.tradeoff_report import tradeoff_grid
    from iprt.measure.view_truth import read_target, views_with_truth
    from iprt.output.grid import print_grid
    from iprt.scene.scene import Scene

    if json and markdown:
        raise IprtError("--json and --markdown: give one of them")
    opened = Scene.open(scene, allow_outside=allow_outside)
    view = listed(view)
    names = _views(opened, view)
    # Pictures are scored over the truth's own background.
    scored = views_with_truth(opened, view) if ssim else []
    targets = [read_target(opened, name, "truth") for name in scored]
    handle = choose_device(device)
    timed = TimedDevice.of(handle)
    path = output or timed.file
    require_writable(path)
    opened.require_not_ours(path)
    table = _measured(opened, names, targets, ComputeDevice(handle), timed)
    keep(table, path)
    with reporting(f"{path} has been written nevertheless"):
        if json:
            print(table.model_dump_json(indent=2))
        else:
            print_grid(tradeoff_grid(table), markdown=markdown)
        LOG.info("%s: written", path)
    return 0


def _views(scene: Scene, names: tuple[str, ...]) -> list[str]:
    """Return the names of the views to time.

    Default: the first views with a truth, or the first of all. Raise an error if there is none.
    """
    with_truth = [name for name, entry in scene.views.items() if entry.truth is not None]
    found = list(dict.fromkeys(names)) or (with_truth or list(scene.views))[:MOST_VIEWS]
    if not found:
        raise IprtError(f"{scene.name}: has no view to time; add one to its scene.toml")
    return found


def _measured(
    scene: Scene,
    names: Sequence[str],
    targets: Sequence[Target],
    compute: ComputeDevice,
    timed: TimedDevice,
) -> Tradeoff:
    from iprt.commands.progress import progress_bar
    from iprt.measure.calibration import (
        SSIM_FRAMES,
        TIMES_S,
        TimedView,
        measure_ssim,
        measure_times,
        tradeoff_of,
    )
    from iprt.measure.tradeoff import shipped
    from iprt.settings.ladder import LADDER

    frame = scene.frame()
    views = [
        TimedView(name, frame, scene.instances_of(name), scene.views[name].view) for name in names
    ]
    with progress_bar("timing", round(TIMES_S), "s") as progress:
        times = measure_times(compute, views, progress=lambda seconds: progress(int(seconds)))
    if not targets:
        known = shipped()
        ssim = {entry.name: entry.ssim for entry in known.entries}
        return tradeoff_of(timed, scene.name, times, known.truth, ssim, known.frames)
    total = len(targets) * len(LADDER) * SSIM_FRAMES[-1]
    with progress_bar("rendering", total) as progress:
        scored = measure_ssim(scene, targets, device=compute, progress=progress)
    return tradeoff_of(timed, scene.name, times, scene.name, scored, SSIM_FRAMES)
