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
    from iprt.measure.camera_motion import Reel
    from iprt.measure.cost_report import CostReport
    from iprt.scene.scene import Scene
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
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    check_count("--repeat", repeat)
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.files.atomic import require_writable
    from iprt.measure.changes import require_comparable
    from iprt.measure.cost_report import read_report
    from iprt.output.timeline import write_trace
    from iprt.scene.scene import Scene

    old = None if compare is None else read_report(compare)
    opened = Scene.open(scene, allow_outside=allow_outside)
    settings = setting_flags.resolved(opened, method=method)
    if trace is not None:
        require_writable(trace)
        opened.require_not_ours(trace)
        if compare is not None and trace.resolve() == compare.resolve():
            raise IprtError(f"--trace {trace}: is the file of --compare; name another")
    reel = _reel(opened, view, size, settings)
    compute = ComputeDevice(choose_device(device))
    if old is not None:
        try:
            require_comparable(old, scene=opened.name, device=compute.name, view=reel.view)
        except IprtError as error:
            raise IprtError(f"--compare {compare}: {error}") from error
    if trace is not None:
        compute.profile.trace()
    report = _measure(compute, reel, opened.name, repeat)
    if trace is not None:
        write_trace(trace, compute.profile.spans(), compute.name)
    _print(report, old, str(compare), json=json)
    return 0


def _reel(scene: Scene, name: str | None, size: tuple[int, int] | None, settings: Settings) -> Reel:
    """Return the video, if the scene has one, else a turn around the panorama."""
    from iprt.commands.views import choose_view, moving_view
    from iprt.measure.camera_motion import Playback, Turn

    if len(scene.frame_indices) > 1:
        return Playback(scene, *moving_view(scene, name, size=size), settings)
    view, instances = choose_view(scene, name, size=size)
    return Turn(scene.frame(), instances, view, settings)


def _measure(device: ComputeDevice, reel: Reel, scene: str, frames: int) -> CostReport:
    from iprt.commands.progress import progress_bar
    from iprt.measure.bench import COUNTED_FRAMES, WARM_UP, count_work, timed

    # The profile keeps the timed frames for the trace: time first, then count.
    with progress_bar("timing", WARM_UP + frames) as progress:
        report, _ = timed(device, reel, scene=scene, frames=frames, progress=progress)
    with progress_bar("counting", WARM_UP + COUNTED_FRAMES) as progress:
        counted = count_work(device, reel, progress)
    return report.with_work(device.profile, counted)


def _print(report: CostReport, old: CostReport | None, file: str, *, json: bool) -> None:
    """Print the results to stdout, with the changes since the report `old` from `file`."""
    from iprt.measure.changes import changed_settings, changes
    from iprt.measure.cost_tables import change_grid, compile_grid, memory_grid, part_grid
    from iprt.measure.results import json_text
    from iprt.output.grid import print_grid

    found = [] if old is None else changes(old, report)
    if json:
        since = [
            {**vars(c), "difference_ms": c.difference_ms, "beyond_noise": c.beyond_noise}
            for c in found
        ]
        print(json_text({**vars(report), "changes": since}))
    elif old is not None:
        print_grid(change_grid(found, changed_settings(old, report), file))
    else:
        for grid in (part_grid(report), memory_grid(report), compile_grid(report)):
            print_grid(grid)
