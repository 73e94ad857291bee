"""`iprt bench`: time of a frame, by pass."""

from __future__ import annotations

from pathlib import Path

import tyro

from iprt.commands.flag_types import Size
from iprt.commands.measurement_flags import check_count
from iprt.commands.setting_flags import BALANCED, ChosenSettings


def bench(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    view: str | None = None,
    size: Size = None,
    repeat: int = 30,
    method: str | None = None,
    setting_flags: ChosenSettings = BALANCED,
    device: str | None = None,
    json: bool = False,
    allow_outside: bool = False,
) -> int:
    """Time the frames of a camera that turns slowly, pass by pass.

    Every frame is rendered for a new direction, rasterization included; the video and the objects
    stand still. Times are medians over the frames, after a warm-up.

    Parameters
    ----------
    scene
        Scene folder.
    view
        Name of a view of the scene, or `equirect` for the whole panorama, which does not turn but
        is rendered again for every frame. Default: the scene's first view.
    size
        Width and height in pixels. Default: the view's own.
    repeat
        Frames to time.
    method
        Relighting method: a name from `iprt methods`. Short for --set method=.
    device
        OpenCL device: gpu, cpu, PLATFORM:DEVICE such as 0:0 (`iprt doctor` lists them), or part of
        a name. Default: $IPRT_DEVICE, or else the fastest.
    json
        Print a JSON object instead of a table.
    allow_outside
        Follow symbolic links that lead out of the scene folder.

    Returns
    -------
    int
        Exit status 0.
    """
    check_count("--repeat", repeat)
    from iprt.commands.progress import progress_bar
    from iprt.commands.views import choose_view
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.measure.bench import WARM_UP, timed
    from iprt.measure.camera_motion import Turn
    from iprt.measure.cost_tables import pass_grid
    from iprt.measure.results import json_text
    from iprt.memory import require_memory
    from iprt.output.grid import print_grid
    from iprt.scene.scene import Scene

    opened = Scene.open(scene, allow_outside=allow_outside)
    settings = setting_flags.resolved(opened, method=method)
    chosen, instances = choose_view(opened, view, size=size)
    frame = opened.frame()
    compute = ComputeDevice(choose_device(device))
    require_memory(compute, frame, instances, chosen, settings)
    with progress_bar("timing", WARM_UP + repeat) as progress:
        turn = Turn(frame, instances, chosen, settings)
        report, _ = timed(compute, turn, scene=opened.name, frames=repeat, progress=progress)
    if json:
        print(json_text(report))
    else:
        print_grid(pass_grid(report))
    return 0
