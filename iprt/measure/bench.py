"""Times per view frame of a head that turns slowly: every pass of the view clock in every frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import TYPE_CHECKING

from iprt.output.table import PassRow, pass_rows
from iprt.scene.camera import View
from iprt.settings import Settings

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.renderer import Renderer
    from iprt.scene.frame import Frame
    from iprt.scene.mesh import Instance

TURN_DEG = 0.2
"""Yaw per frame: at 60 frames a second 12 degrees a second, a slow look around."""
SWING = 25
"""Frames from the middle of the swing to its end, so that the objects stay in view."""
WARM_UP = 16
"""Frames before the first that counts: one cycle of the tracing grid, in which the mask has also
learned where objects have influence."""


@dataclass(frozen=True)
class Benchmark:
    """Medians over the frames of one run.

    Attributes
    ----------
    device, method : str
    width, height, frames : int
    wall_ms : float
        Milliseconds from asking for a frame until the device has finished it, as one clock shows
        them: passes, Python, and waiting. The picture stays on the device.
    ms : float
        Milliseconds of all passes of a frame.
    traced : float or None
        Fraction of the pixels at which rays relight the real surface; None where none are traced.
    prepare_ms : float
        Device time spent once per video frame.
    compile_ms : float
    passes : tuple of PassRow
        Medians per pass, `share` of their sum.
    """

    device: str
    method: str
    width: int
    height: int
    frames: int
    wall_ms: float
    ms: float
    traced: float | None
    prepare_ms: float
    compile_ms: float
    passes: tuple[PassRow, ...]

    def record(self) -> dict[str, object]:
        """The same as plain data."""
        return asdict(self)


def benchmark(
    device: ComputeDevice,
    frame: Frame,
    instances: Sequence[Instance],
    view: View,
    settings: Settings,
    *,
    frames: int,
    progress: Callable[[int], None] | None = None,
) -> Benchmark:
    """Time `frames` frames after `WARM_UP` others, the view turning by `TURN_DEG` for each.

    Parameters
    ----------
    view : View
        The middle of the turn; an equirect view does not turn, but is made anew for every frame.
    progress : callable, optional
        Called with the number of frames done so far, those of the warm-up included.
    """
    from iprt.renderer import Renderer

    profile = device.profile
    profile.reset()
    walls: list[float] = []
    traced: list[float] = []
    rows: list[list[PassRow]] = []
    with Renderer(device, frame, instances, view, settings) as renderer:
        device.finish()
        prepare_ms = sum(entry.ms for entry in profile.passes())
        for index in range(WARM_UP + frames):
            profile.reset()
            start = time.perf_counter()
            renderer.look(turned(view, index))
            renderer.step()
            device.queue.finish()
            wall = (time.perf_counter() - start) * 1e3
            if index >= WARM_UP:
                walls.append(wall)
                rows.append(pass_rows(profile))
                traced += _traced_fraction(renderer)
            if progress is not None:
                progress(index + 1)
    return Benchmark(
        device=device.name,
        method=settings.method,
        width=view.width,
        height=view.height,
        frames=frames,
        wall_ms=median(walls),
        ms=median(sum(row.ms for row in passes) for passes in rows),
        traced=median(traced) if traced else None,
        prepare_ms=prepare_ms,
        compile_ms=profile.compile_ms,
        passes=median_rows(rows),
    )


def turned(view: View, index: int) -> View:
    """The view of frame `index`: to and fro about `view`, by `TURN_DEG` a frame."""
    if view.projection == "equirect":
        return view
    phase = (index + SWING) % (4 * SWING)
    steps = min(phase, 4 * SWING - phase) - SWING
    return replace(view, yaw_deg=view.yaw_deg + TURN_DEG * steps)


def median_rows(frames: Sequence[Sequence[PassRow]]) -> tuple[PassRow, ...]:
    """Medians per pass over frames; a pass that a frame lacks took no time in it."""
    names = list(dict.fromkeys(row.name for passes in frames for row in passes))
    columns = ("ms", "device_ms", "host_ms", "launches")
    medians: dict[str, dict[str, float]] = {}
    for name in names:
        of_pass = [row for passes in frames for row in passes if row.name == name]
        missing = [0.0] * (len(frames) - len(of_pass))
        medians[name] = {
            column: median([getattr(row, column) for row in of_pass] + missing)
            for column in columns
        }
    total = sum(values["ms"] for values in medians.values())
    return tuple(
        PassRow(name=name, share=values["ms"] / total if total > 0.0 else 0.0, **values)
        for name, values in medians.items()
    )


def _traced_fraction(renderer: Renderer) -> list[float]:
    """The fraction, in a list; an empty list where no rays relight the real layer."""
    pixels = renderer.real_pixels
    if pixels is None:
        return []
    view = renderer.view
    return [float(renderer.device.read(pixels.mask.count)[0]) / (view.width * view.height)]
