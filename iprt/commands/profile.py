"""`iprt profile`: time and memory of a frame, by pass and kernel."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from iprt.commands.flag_types import Size
from iprt.commands.measurement_flags import check_count
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.geometry.camera import View
    from iprt.measure.camera_motion import Reel
    from iprt.measure.cost_report import CostReport
    from iprt.measure.profile_file import OldReport
    from iprt.scene.scene import Scene, SceneView
    from iprt.settings.model import Settings


def profile(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    view: str | None = None,
    size: Size = None,
    repeat: int = 48,
    method: str | None = None,
    setting_flags: ChosenSettings = BALANCED,
    device: str | None = None,
    compare: Path | None = None,
    trace: Path | None = None,
    json: bool = False,
    csv: bool = False,
    allow_outside: bool = False,
) -> int:
    """Show how long every pass and kernel takes, the memory it moves, and the rays it traces.

    A video plays, frame after frame, with all that moves in it; in a still panorama the view turns
    slowly, as for `iprt bench`. Times are medians over the frames, after a warm-up. Rays,
    their steps and active work items are counted in separate frames, by instrumented kernels.

    The bytes of a kernel are the sizes of its buffers, each counted once. A kernel moves less if it
    needs only part of a buffer, and more if caches miss. Bandwidth is shown only for kernels that
    read whole buffers, not for kernels that follow rays or lists.

    Parameters
    ----------
    scene
        Scene folder.
    view
        Name of a view of the scene, or `equirect` for the whole panorama. Default: the scene's
        first view.
    size
        Width and height in pixels. Default: the view's own.
    repeat
        Frames to time; from 16 on, the noise of the times is estimated too.
    method
        Relighting method: a name from `iprt methods`. Short for --set method=.
    device
        OpenCL device: gpu, cpu, PLATFORM:DEVICE such as 0:0 (`iprt doctor` lists them), or part of
        a name. Default: $IPRT_DEVICE, or else the fastest.
    compare
        JSON file that this verb or `iprt bench` printed before: show the changes since, and
        which changes exceed the noise.
    trace
        JSON file to write a trace to: what ran when, for Perfetto or Chrome's about:tracing.
    json
        Print a JSON object instead of tables.
    csv
        Print comma-separated values, with a row for each pass, part of a pass, and program.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    check_count("--repeat", repeat)
    if json and csv:
        raise IprtError("--json and --csv: give one of them")
    if csv and compare is not None:
        raise IprtError("--compare: is for a table or --json, not for --csv")

    from iprt.commands.views import moving_view
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.files.atomic import require_writable
    from iprt.measure.profile_file import read_profile
    from iprt.scene.scene import Scene

    old = None if compare is None else read_profile(compare)
    opened = Scene.open(scene, allow_outside=allow_outside)
    settings = setting_flags.resolved(opened, method=method)
    if trace is not None:
        require_writable(trace)
        opened.require_not_ours(trace)
        if compare is not None and trace.resolve() == compare.resolve():
            raise IprtError(f"--trace {trace}: is the file of --compare; name another")
    chosen, objects = moving_view(opened, view, size=size)
    reel = _reel(opened, chosen, objects, settings)
    compute = ComputeDevice(choose_device(device))
    if old is not None:
        _require_comparable(old, compare, opened, compute, reel)
    if trace is not None:
        compute.profile.trace()
    report = _measure(compute, reel, opened.name, repeat)
    if trace is not None:
        from iprt.output.timeline import write_trace

        write_trace(trace, compute.profile.spans(), compute.name)
    _print(report, old, compare, json=json, csv=csv)
    return 0


def _reel(
    scene: Scene, view: SceneView | View, objects: tuple[str, ...] | None, settings: Settings
) -> Reel:
    """Return the video, if the scene has one, else a turn around the panorama."""
    from iprt.geometry.camera import View
    from iprt.measure.camera_motion import Playback, Turn

    if len(scene.frame_indices) > 1:
        return Playback(scene, view, objects, settings)
    instances = scene.instances if objects is None else scene.instances_named(objects)
    middle = view if isinstance(view, View) else view.view
    return Turn(scene.frame(), instances, middle, settings)


def _require_comparable(
    old: OldReport, file: Path | None, scene: Scene, device: ComputeDevice, reel: Reel
) -> None:
    from iprt.measure.changes import require_comparable

    try:
        require_comparable(old, scene=scene.name, device=device.name, view=reel.view)
    except IprtError as error:
        raise IprtError(f"--compare {file}: {error}") from error


def _measure(device: ComputeDevice, reel: Reel, scene: str, frames: int) -> CostReport:
    from iprt.commands.progress import progress_bar
    from iprt.measure.bench import COUNTED_FRAMES, WARM_UP, count_work, timed

    # The profile keeps the timed frames for the trace: time first, then count.
    with progress_bar("timing", WARM_UP + frames) as progress:
        report = timed(device, reel, scene=scene, frames=frames, progress=progress)
    with progress_bar("counting", WARM_UP + COUNTED_FRAMES) as progress:
        counted = count_work(device, reel, progress)
    return report.with_work(device.profile, counted)


def _print(
    report: CostReport, old: OldReport | None, file: Path | None, *, json: bool, csv: bool
) -> None:
    """Print the results to stdout."""
    from iprt.measure.changes import changed_settings, changes
    from iprt.measure.profile_file import csv_text, json_text
    from iprt.measure.table import change_grid, compile_grid, memory_grid, part_grid
    from iprt.output.grid import print_grid

    found = None if old is None else changes(old, report)
    if csv:
        print(csv_text(report), end="")
    elif json:
        since = None if found is None else [change.record() for change in found]
        print(json_text(report, since))
    elif old is not None and found is not None:
        print_grid(change_grid(found, changed_settings(old, report), str(file)))
    else:
        for grid in (part_grid(report), memory_grid(report), compile_grid(report)):
            print_grid(grid)
