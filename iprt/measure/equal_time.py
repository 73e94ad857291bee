"""Comparison of methods or settings at equal time, with their costs per frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from iprt.errors import IprtError
from iprt.measure.bench import WARM_UP
from iprt.measure.camera_motion import turned
from iprt.measure.compare import scored
from iprt.measure.report import Figures, scored_pictures
from iprt.measure.sweep import Combination
from iprt.measure.timed_renderers import TimedIprt, TimedRenderer
from iprt.measure.view_truth import Radiance, Scores, Target, with_frames
from iprt.memory import require_memory
from iprt.output.grid import Grid

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.geometry.camera import View
    from iprt.geometry.mesh import Instance
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings

MAX_SECONDS = 3600.0
ROUNDS = 10
"""Number of measurements of each kind. Their median is the cost."""
AFTER = 3
"""Frames until all work of a change is done: objects move, stop, and are at rest."""
NUDGE_M = 0.01
"""Displacement of moving objects in metres, in a room with a median depth of 2 m."""


@dataclass(frozen=True)
class Costs:
    """Milliseconds per frame while the view turns, and memory.

    Attributes
    ----------
    frame : float
        Median time of a frame.
    video, objects : float
        Median additional time, over all affected frames, of a new but equal video frame, and of
        all objects moving and stopping.
    bytes : int
        Size of the device's buffers.
    """

    frame: float
    video: float
    objects: float
    bytes: int


@dataclass(frozen=True)
class TimedPicture:
    """The last picture finished within a time budget.

    Attributes
    ----------
    budget : float or None
        Time budget in seconds. None: a given number of frames instead.
    frames : int
        Accumulated frames; 1 if even the first one exceeds the budget.
    seconds : float
        Time from the loaded scene to the picture; see `TimedRenderer.picture`.
    """

    budget: float | None
    frames: int
    seconds: float
    scores: Scores


@dataclass(frozen=True)
class EqualTime:
    """Result of one combination of settings on one view, with pictures by rising budget."""

    combination: Combination
    target: Target
    costs: Costs
    pictures: tuple[TimedPicture, ...]

    def record(self) -> dict[str, object]:
        """Return the result as plain data."""
        return {
            "view": self.target.name,
            "values": dict(self.combination.values),
            "settings": self.combination.settings.model_dump(mode="json"),
            "costs": asdict(self.costs),
            "pictures": [
                {**asdict(picture), "scores": picture.scores.record()} for picture in self.pictures
            ],
        }


def parse_seconds(text: str) -> list[float]:
    """Parse rising times in seconds, separated by commas.

    Raises
    ------
    IprtError
        `text` is not such a list.
    """
    try:
        found = [float(word) for word in text.split(",")]
        rising = all(a < b for a, b in zip([0.0, *found], [*found, math.inf], strict=True))
        if not rising or found[-1] > MAX_SECONDS:
            raise ValueError
    except ValueError:
        raise IprtError(
            f"--seconds {text}: expected rising times up to {MAX_SECONDS:g} s, such as 0.2,1,5"
        ) from None
    return found


def run_equal_time(
    scene: Scene,
    targets: Sequence[Target],
    chosen: Sequence[Combination],
    budgets: Sequence[float],
    *,
    device: ComputeDevice,
    frames: int,
    progress: Callable[[int], None] | None = None,
) -> Iterator[tuple[EqualTime, list[Radiance]]]:
    """Measure every combination on every view; yield results with their linear pictures.

    Parameters
    ----------
    budgets : sequence of float
        Seconds per picture, rising.
    frames : int
        Number of frames of one more picture, without a time budget.
    progress : callable, optional
        Called with the number of combinations and views done so far.
    """
    done = 0
    for target, frame in with_frames(scene, targets):
        instances = scene.instances_named(target.objects)
        for combination in chosen:
            costs = costs_of(device, frame, instances, target.view, combination.settings)
            renderer = TimedIprt(combination, device, frame, instances, target)
            renderer.prepare(0)
            found = pictures_within(renderer, budgets)
            found.append((frames, *renderer.picture(frames, 0)))
            pictures = tuple(
                TimedPicture(budget, count, seconds, scored(target, color, combination.label))
                for budget, (count, seconds, color) in zip([*budgets, None], found, strict=True)
            )
            yield EqualTime(combination, target, costs, pictures), [color for *_, color in found]
            done += 1
            if progress is not None:
                progress(done)


def pictures_within(
    renderer: TimedRenderer, budgets: Sequence[float]
) -> list[tuple[int, float, Radiance]]:
    """Return frames, seconds and linear radiance of the last picture within each budget.

    The first picture counts even if it exceeds the budget. `budgets` are rising.
    """
    count, found = 1, []
    seconds, color = renderer.picture(count, 0)
    following = renderer.picture(count + 1, 0)
    for budget in budgets:
        while following[0] <= budget:
            count, (seconds, color) = count + 1, following
            following = renderer.picture(count + 1, 0)
        found.append((count, seconds, color))
    return found


def costs_of(
    device: ComputeDevice,
    frame: Frame,
    instances: Sequence[Instance],
    view: View,
    settings: Settings,
) -> Costs:
    """Measure the costs of a frame while the view turns; medians of `ROUNDS` measurements.

    Raises
    ------
    DeviceError
        The picture needs more memory than the device has.
    """
    from iprt.renderer import Renderer

    plan = require_memory(device, frame, instances, view, settings)
    moved = [replace(instance, to_world=_nudge() @ instance.to_world) for instance in instances]
    with Renderer(device, frame, instances, view, settings) as renderer:
        count = 0

        def step() -> None:
            nonlocal count
            count += 1
            renderer.look(turned(view, count))
            renderer.step()
            device.wait()

        def with_video() -> None:
            renderer.load(replace(frame))  # an equal frame, but a new object

        def with_objects() -> None:
            renderer.move(moved if renderer.instances[0] is instances[0] else instances)

        changes = {"frame": lambda: None, "video": with_video}
        if instances:
            changes["objects"] = with_objects
        times: dict[str, list[float]] = {name: [] for name in changes}
        for _ in range(WARM_UP):
            step()
        for number in range(1 + ROUNDS):
            for name, change in changes.items():
                start = perf_counter()
                change()
                for _ in range(AFTER):
                    step()
                if number:  # the first round compiles kernels
                    times[name].append(1e3 * (perf_counter() - start))
        device.profile.reset()
    medians = {name: median(values) for name, values in times.items()}
    base = medians["frame"]
    return Costs(
        frame=base / AFTER,
        video=medians["video"] - base,
        objects=medians.get("objects", base) - base,
        bytes=plan.bytes,
    )


def _nudge() -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[0, 3] = NUDGE_M
    return matrix


# Tables ------------------------------------------------------------------------------------------


def costs_grid(results: Sequence[EqualTime]) -> Grid:
    """Build a table with a row per combination and view. `results` must not be empty."""
    return Grid(
        title="Cost of a frame",
        columns=("view", "settings", "ms/frame", "video ms", "objects ms", "MB"),
        rows=tuple(
            (
                result.target.name,
                result.combination.label,
                f"{result.costs.frame:.1f}",
                f"{result.costs.video:+.1f}",
                f"{result.costs.objects:+.1f}",
                f"{result.costs.bytes / 1e6:.0f}",
            )
            for result in results
        ),
        notes=(
            "ms/frame: a head turns, nothing else moves. video, objects: additional time until all "
            "is at rest, after the video advances to an equal frame, or after all objects have "
            "moved. MB: buffers on the device.",
        ),
        words=2,
    )


def equal_time_grid(results: Sequence[EqualTime]) -> Grid:
    """Build a table of SSIM and FLIP by time budget, with a row per combination and view."""
    names = [_budget_name(picture) for picture in results[0].pictures]
    flip = any(p.scores.flip is not None for result in results for p in result.pictures)
    return Grid(
        title=f"Accuracy at equal time: SSIM of each cut{', FLIP' if flip else ''} [frames]",
        columns=("view", "settings", *names),
        rows=tuple(
            (
                result.target.name,
                result.combination.label,
                *(_cell(picture) for picture in result.pictures),
            )
            for result in results
        ),
        notes=(
            "SSIM of each cut, FLIP, [frames]. Seconds count from the scene in memory, with "
            "kernels compiled, to the last picture that was finished in time, or the first one.",
        ),
        words=2,
    )


def equal_time_figures(result: EqualTime, colors: Sequence[Radiance]) -> Figures:
    """Show the cuts of all pictures, the truth, and the last picture's difference from it."""
    target = result.target
    *_, last = colors
    shown = [
        replace(scored_pictures(target, color, crop=True)[0], label=_budget_name(picture))
        for picture, color in zip(result.pictures, colors, strict=True)
    ]
    _, truth, *others = scored_pictures(target, last, crop=True)
    return Figures(
        title=f"{target.name}, {result.combination.label}",
        caption="; ".join(f"{_budget_name(p)}: {_cell(p)}" for p in result.pictures),
        pictures=(*shown, truth, *others),
    )


def _budget_name(picture: TimedPicture) -> str:
    return f"{picture.frames} frames" if picture.budget is None else f"{picture.budget:g} s"


def _cell(picture: TimedPicture) -> str:
    scores = picture.scores
    values = [f"{value:.3f}" for value in scores.ssim_cuts or (scores.ssim,)]
    if scores.flip is not None:
        values.append(f"{scores.flip:.3f}")
    if picture.budget is not None:
        values.append(f"[{picture.frames}]")
    return " ".join(values)
