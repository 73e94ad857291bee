"""`iprt bench-video`: speed of the preparation of a video's frames."""

from __future__ import annotations

from pathlib import Path

import tyro

from iprt.commands.flag_types import Size
from iprt.commands.measurement_flags import check_count
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.errors import IprtError


def bench_video(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    size: Size = None,
    repeat: int = 30,
    method: str | None = None,
    setting_flags: ChosenSettings = BALANCED,
    device: str | None = None,
    json: bool = False,
    allow_outside: bool = False,
) -> int:
    """Time how fast frames of a video are prepared for rendering.

    The time runs from decoded pictures until rays can be traced in them. Decoding and rendering
    are left out.

    Parameters
    ----------
    scene
        Scene folder.
    size
        Width and height in pixels to which the panorama is enlarged. Default: its own.
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
    if size is not None and size[0] != 2 * size[1]:
        raise IprtError(f"--size {size[0]} {size[1]}: a panorama is twice as wide as high")
    from iprt.commands.progress import progress_bar
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.measure.frame_preparation import WARM_UP, preparation_grid, time_preparation
    from iprt.measure.results import json_text
    from iprt.output.grid import print_grid
    from iprt.scene.scene import Scene

    opened = Scene.open(scene, allow_outside=allow_outside)
    settings = setting_flags.resolved(opened, method=method)
    compute = ComputeDevice(choose_device(device))
    with progress_bar("timing", WARM_UP + repeat) as progress:
        times = time_preparation(
            compute, opened, settings, frames=repeat, size=size, progress=progress
        )
    if json:
        print(json_text(times))
    else:
        print_grid(preparation_grid(times))
    return 0
