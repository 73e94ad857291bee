"""`iprt bench`: how long a frame takes, pass by pass."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from iprt.errors import IprtError

if TYPE_CHECKING:
    from rich.table import Table

    from iprt.measure.bench import Benchmark

MAX_FRAMES = 100_000


def bench(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    view: str | None = None,
    size: tuple[int, int] | None = None,
    frames: int = 30,
    method: Literal["iprt", "ibl"] = "iprt",
    device: str | None = None,
    json: bool = False,
) -> int:
    """Time the frames of a head that turns slowly, after a warm-up, pass by pass.

    Every frame does all that a new direction asks for, rasterization included, at one ray per
    pixel; the video and the objects stand still. Figures are medians over the frames.

    Parameters
    ----------
    scene
        Scene folder.
    view
        Name of a view of the scene, or `equirect` for the whole panorama, which does not turn but
        is made anew for every frame. Default: the scene's first view.
    size
        Width and height in pixels. Default: the view's own.
    frames
        Frames to time.
    method
        How virtual objects are lit; `ibl` is the baseline: a distant environment without real
        geometry.
    device
        gpu, cpu, a place such as 0:0 (see `iprt doctor`), or part of a device's name. Default: the
        fastest kind there is.
    json
        Print a JSON object instead of a table.

    Returns
    -------
    int
        Exit status 0.
    """
    if not 1 <= frames <= MAX_FRAMES:
        raise IprtError(f"--frames {frames}: expected 1 to {MAX_FRAMES}")

    from rich.console import Console

    from iprt.commands.progress import progress_bar
    from iprt.commands.render import choose_view
    from iprt.device.choose import choose_device
    from iprt.device.compute import ComputeDevice
    from iprt.measure.bench import WARM_UP, benchmark
    from iprt.memory import require_memory
    from iprt.scene.scene import Scene
    from iprt.settings import Settings

    opened = Scene.open(scene)
    chosen, objects = choose_view(opened, view, size=size)
    instances = opened.instances if objects is None else opened.instances_named(objects)
    frame = opened.frame()
    settings = Settings(method=method)
    compute = ComputeDevice(choose_device(device))
    require_memory(compute, frame, instances, chosen, settings)
    with progress_bar("timing", WARM_UP + frames) as progress:
        result = benchmark(
            compute,
            frame,
            instances,
            chosen,
            settings,
            frames=frames,
            progress=progress,
        )
    if json:
        print(json_format.dumps({"scene": opened.name, **result.record()}, indent=2))
    else:
        Console().print(bench_table(result))
    return 0


def bench_table(result: Benchmark) -> Table:
    """Medians per pass; what a frame takes as a whole stands in the caption."""
    from iprt.output.table import rows_table

    caption = f"wall: {result.wall_ms:.2f} ms/frame, {1e3 / result.wall_ms:.1f} frames/s"
    if result.traced is not None:
        caption += f"\nreal surfaces relit by rays at {result.traced:.1%} of the pixels"
    caption += (
        f"\nonce: compiling kernels {result.compile_ms:.0f} ms, "
        f"preparing the panorama {result.prepare_ms:.0f} ms"
    )
    return rows_table(
        result.passes,
        title=(
            f"{result.width}x{result.height}, method {result.method}, "
            f"medians of {result.frames} frames on {result.device}"
        ),
        caption=caption,
    )
