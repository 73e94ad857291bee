"""Measurement of the ladder's entries: frame times on a device, and SSIM against truth."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from statistics import fmean, median
from typing import TYPE_CHECKING

from iprt import __version__
from iprt.measure.bench import timed_together
from iprt.measure.camera_motion import Turn
from iprt.measure.combinations import Combination
from iprt.measure.convergence_curves import run_convergence
from iprt.measure.intervals import Ratio
from iprt.measure.measurement import Measurement
from iprt.measure.tradeoff import Entry, Tradeoff
from iprt.measure.tradeoff_cache import TimedDevice
from iprt.measure.view_truth import Target
from iprt.memory import RenderPlan
from iprt.settings.ladder import BALANCED, LADDER, entry_settings
from iprt.settings.model import Settings
from iprt.settings.overrides import changed

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.geometry.camera import View
    from iprt.geometry.mesh import Instance
    from iprt.scene.scene import Scene

SIDES = (192, 384, 768, 1536)
"""Timed picture sizes, as the sides of squares with the same number of pixels. Each has four times
the pixels of the one before. The first two are always timed, the others if time and memory allow.
"""
ROUNDS = 40
"""Largest number of frames of each entry. Their median is used."""
TIMES_S = 90.0
"""Target for the seconds of all timings. The first two sizes may exceed it."""
FIRST_SHARE = 0.4
"""Share of `TIMES_S` for the first size, which includes compiling kernels."""
SSIM_FRAMES = (1, 4, 16, 64)
"""Numbers of frames after which SSIM is measured."""
MEMORY_SHARE = 0.5
"""Share of the device's memory for the renderers of all entries together."""

Progress = Callable[[float], None]
"""Function called with the seconds spent so far."""


@dataclass(frozen=True)
class TimedView:
    """A view to time."""

    name: str
    frame: Frame
    instances: Sequence[Instance]
    view: View

    def reels(self, side: int) -> dict[str, Turn]:
        """Return a turning view for each entry's settings, `BALANCED` first.

        Pictures have as many pixels as a square of `side` pixels.
        """
        scale = side / math.sqrt(self.view.width * self.view.height)
        width, height = (max(1, round(scale * n)) for n in (self.view.width, self.view.height))
        view = self.view.resized(width, height)
        names = [BALANCED, *(name for name in LADDER if name != BALANCED)]
        return {
            name: Turn(self.frame, self.instances, view, ladder_settings(name)) for name in names
        }

    def bytes(self, side: int) -> int:
        """Return the bytes that the renderers of all entries need together."""
        return sum(
            RenderPlan.of(reel.frame, reel.instances, reel.view, reel.settings).bytes
            for reel in self.reels(side).values()
        )


@dataclass(frozen=True)
class Times:
    """Frame times of all entries in a view of one size.

    Attributes
    ----------
    pixels : int
    base_s : float
        Median seconds of a frame of `BALANCED`.
    ratios : mapping of str to Ratio
        Time of each entry divided by the time of `BALANCED`.
    """

    pixels: int
    base_s: float
    ratios: Mapping[str, Ratio]

    def seconds(self, name: str) -> float:
        """Return the seconds per frame of an entry."""
        return self.base_s * self.ratios[name].value


def ladder_settings(name: str) -> Settings:
    """Return the settings of an entry."""
    return changed(Settings(), entry_settings(name))


def measure_times(
    device: ComputeDevice,
    views: Sequence[TimedView],
    *,
    progress: Progress,
    clock: Callable[[], float] = time.monotonic,
) -> dict[str, list[Times]]:
    """Time all entries on each view, and return the times by the view's name.

    Sizes are in rising order, at least two. The measurement takes at most `TIMES_S` including
    compilation, unless the fewest frames of the first two sizes take longer.
    """
    start, before_s = clock(), 0.0
    found: dict[str, list[Times]] = {view.name: [] for view in views}
    for number, side in enumerate(SIDES):
        begun = clock()
        if number >= 2:
            needed = max(view.bytes(side) for view in views)
            if 4.0 * before_s > start + TIMES_S - begun or needed > MEMORY_SHARE * device.memory:
                break
        for place, view in enumerate(views):
            left = start + TIMES_S * (FIRST_SHARE if number == 0 else 1.0) - clock()
            until = clock() + left / (len(views) - place)

            def enough(rounds: int, until: float = until) -> bool:
                progress(clock() - start)
                return rounds >= ROUNDS or clock() > until

            found[view.name].append(_timed(device, view.reels(side), enough))
        before_s = clock() - begun
    return found


def _timed(
    device: ComputeDevice, reels: Mapping[str, Turn], enough: Callable[[int], bool]
) -> Times:
    base, *_ = reels.values()
    walls = timed_together(device, list(reels.values()), enough)
    ratios = {name: Ratio.of(mine, walls[0]) for name, mine in zip(reels, walls, strict=True)}
    return Times(base.view.width * base.view.height, 1e-3 * median(walls[0]), ratios)


def measure_ssim(
    scene: Scene,
    targets: Sequence[Target],
    *,
    device: ComputeDevice,
    progress: Callable[[int], None],
) -> dict[str, dict[str, list[float]]]:
    """Measure the mean SSIM of the cuts after each of `SSIM_FRAMES`, by entry and view."""
    chosen = tuple(Combination({"entry": name}, ladder_settings(name)) for name in LADDER)
    plan = Measurement(scene, tuple(targets), chosen, device)
    found: dict[str, dict[str, list[float]]] = {name: {} for name in LADDER}
    curves = run_convergence(plan, SSIM_FRAMES, progress)
    for (target, name), curve in zip(product(targets, LADDER), curves, strict=True):
        found[name][target.name] = [round(point.scores.accuracy, 4) for point in curve.points]
    return found


def tradeoff_of(
    timed: TimedDevice,
    scene: str,
    times: Mapping[str, Sequence[Times]],
    truth: str,
    ssim: Mapping[str, Mapping[str, Sequence[float]]],
    frames: Sequence[int],
) -> Tradeoff:
    """Build the table of the measurements.

    Parameters
    ----------
    scene, truth : str
        Names of the scenes of `times` and of `ssim`.
    times : mapping of str to sequence of Times
        Times by view, in rising order of size.
    ssim : mapping of str to mapping of str to sequence of float
        SSIM after each of `frames`, by entry and view.
    """
    entries = [
        Entry(
            name=name,
            ratio=_ratio([of_view[-1].ratios[name] for of_view in times.values()]),
            seconds={view: _line(name, *of_view[-2:]) for view, of_view in times.items()},
            ssim={view: list(values) for view, values in ssim[name].items()},
        )
        for name in LADDER
    ]
    return Tradeoff(
        version=__version__,
        device=timed.device,
        driver=timed.driver,
        scene=scene,
        truth=truth,
        frames=list(frames),
        entries=entries,
    )


def _ratio(of_views: Sequence[Ratio]) -> list[float]:
    """Return the geometric mean over views, and the lowest and highest ends of the intervals."""
    mean = math.exp(fmean(math.log(ratio.value) for ratio in of_views))
    low = min(ratio.value if ratio.low is None else ratio.low for ratio in of_views)
    high = max(ratio.value if ratio.high is None else ratio.high for ratio in of_views)
    return [round(value, 3) for value in (mean, low, high)]


def _line(name: str, small: Times, large: Times) -> list[float]:
    """Fit a line to the frame time: seconds at zero pixels and seconds per pixel, both >= 0."""
    few, many = small.seconds(name), large.seconds(name)
    slope = (many - few) / (large.pixels - small.pixels)
    slope = min(max(slope, 0.0), many / large.pixels)
    return [float(f"{many - slope * large.pixels:.4g}"), float(f"{slope:.4g}")]
