"""Comparison of methods or settings at equal time, with their costs per frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from iprt.errors import IprtError
from iprt.measure.bench import timed_together
from iprt.measure.camera_motion import Step, Turn, turned
from iprt.measure.combinations import Combination
from iprt.measure.compare import scored
from iprt.measure.measurement import Measurement
from iprt.measure.report import Figures, scored_pictures
from iprt.measure.results import grid_of
from iprt.measure.timed_renderers import TimedRenderer, timed_iprt
from iprt.measure.view_truth import Radiance, Scores, Target
from iprt.memory import require_memory
from iprt.output.grid import Grid

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.geometry.camera import View
    from iprt.geometry.mesh import Instance
    from iprt.renderer import Renderer
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

    view: str
    combination: Combination
    costs: Costs
    pictures: tuple[TimedPicture, ...]


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
    plan: Measurement,
    budgets: Sequence[float],
    frames: int,
    progress: Callable[[int], None] | None = None,
) -> Iterator[tuple[EqualTime, Target, list[Radiance]]]:
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
    for done, (target, combination, renderer) in enumerate(timed_iprt(plan), start=1):
        frame, instances = renderer.frame, renderer.instances
        costs = costs_of(plan.device, frame, instances, target.view, combination.settings)
        renderer.prepare(0)
        found = pictures_within(renderer, budgets)
        found.append((frames, *renderer.picture(frames, 0)))
        pictures = tuple(
            TimedPicture(budget, count, seconds, scored(target, color, combination.label))
            for budget, (count, seconds, color) in zip([*budgets, None], found, strict=True)
        )
        result = EqualTime(target.name, combination, costs, pictures)
        yield result, target, [color for *_, color in found]
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


@dataclass(frozen=True)
class ChangingTurn(Turn):
    """A turning view with a change every `AFTER` frames: `change` takes renderer and number."""

    change: Callable[[Renderer, int], None]

    @contextmanager
    def steps(self, device: ComputeDevice, count: int) -> Iterator[Iterator[Step]]:
        """Yield `count` steps."""
        del device

        def advance(index: int, renderer: Renderer) -> None:
            if index % AFTER == 0:
                self.change(renderer, index // AFTER)
            renderer.look(turned(self.view, index))

        yield (partial(advance, index) for index in range(count))


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
    plan = require_memory(device, frame, instances, view, settings)
    nudge = np.eye(4)
    nudge[0, 3] = NUDGE_M
    moved = [replace(instance, to_world=nudge @ instance.to_world) for instance in instances]

    def stay(renderer: Renderer, number: int) -> None:
        pass

    def load(renderer: Renderer, number: int) -> None:
        renderer.load(replace(frame))  # an equal frame, but a new object

    def move(renderer: Renderer, number: int) -> None:
        renderer.move(moved if number % 2 else instances)

    changes = [stay, load, *([move] if instances else [])]
    turns = [ChangingTurn(frame, instances, view, settings, change) for change in changes]
    walls = timed_together(device, turns, lambda rounds: rounds >= AFTER * ROUNDS)
    base, video, *objects = (
        float(np.median(np.reshape(times[: AFTER * ROUNDS], (ROUNDS, AFTER)).sum(axis=1)))
        for times in walls
    )
    return Costs(base / AFTER, video - base, sum(objects) - base if objects else 0.0, plan.bytes)


# Tables ------------------------------------------------------------------------------------------


def costs_grid(results: Sequence[EqualTime]) -> Grid:
    """Build a table with a row per combination and view. `results` must not be empty."""
    return grid_of(
        "Cost of a frame",
        [
            {
                "view": result.view,
                "settings": result.combination.label,
                "ms/frame": f"{result.costs.frame:.1f}",
                "video ms": f"{result.costs.video:+.1f}",
                "objects ms": f"{result.costs.objects:+.1f}",
                "MB": f"{result.costs.bytes / 1e6:.0f}",
            }
            for result in results
        ],
        "ms/frame: a head turns, nothing else moves. video, objects: additional time until all "
        "is at rest, after the video advances to an equal frame, or after all objects have "
        "moved. MB: buffers on the device.",
        words=2,
    )


def equal_time_grid(results: Sequence[EqualTime]) -> Grid:
    """Build a table of SSIM and FLIP by time budget, with a row per combination and view."""
    flip = any(p.scores.flip is not None for result in results for p in result.pictures)
    return grid_of(
        f"Accuracy at equal time: SSIM of each cut{', FLIP' if flip else ''} [frames]",
        [
            {
                "view": result.view,
                "settings": result.combination.label,
                **{_budget_name(picture): _cell(picture) for picture in result.pictures},
            }
            for result in results
        ],
        "SSIM of each cut, FLIP, [frames]. Seconds count from the scene in memory, with "
        "kernels compiled, to the last picture that was finished in time, or the first one.",
        words=2,
    )


def equal_time_figures(
    result: EqualTime, target: Target, colors: Sequence[Radiance]
) -> tuple[Figures, ...]:
    """Show the cuts of all pictures, the truth, and the last picture's difference from it."""
    *_, last = colors
    shown = [
        replace(scored_pictures(target, color, crop=True)[0], label=_budget_name(picture))
        for picture, color in zip(result.pictures, colors, strict=True)
    ]
    figures = Figures(
        title=f"{target.name}, {result.combination.label}",
        caption="; ".join(f"{_budget_name(p)}: {_cell(p)}" for p in result.pictures),
        pictures=(*shown, *scored_pictures(target, last, crop=True)[1:]),
    )
    return (figures,)


def _budget_name(picture: TimedPicture) -> str:
    return f"{picture.frames} frames" if picture.budget is None else f"{picture.budget:g} s"


def _cell(picture: TimedPicture) -> str:
    scores = picture.scores
    values = [f"{value:.3f}" for value in scores.cuts]
    if scores.flip is not None:
        values.append(f"{scores.flip:.3f}")
    if picture.budget is not None:
        values.append(f"[{picture.frames}]")
    return " ".join(values)
