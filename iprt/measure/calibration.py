"""Measures the entries of the ladder: their times on a device, and their SSIM against truth."""

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
from iprt.measure.convergence import run_convergence
from iprt.measure.intervals import Ratio
from iprt.measure.sweep import Combination
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
"""Pictures that are timed have as many pixels as squares of these sides; four times from one to
the next. Two of them always are, the others where there is time and memory."""
ROUNDS = 40
"""Frames of each entry at most, whose median counts."""
TIMES_S = 90.0
"""Seconds for all times, if two sizes can be timed in less."""
FIRST_SHARE = 0.4
"""Share of `TIMES_S` for the first size, for which kernels are compiled."""
SSIM_FRAMES = (1, 4, 16, 64)
"""Numbers of frames after which SSIM is measured."""
MEMORY_SHARE = 0.5
"""Share of the device's memory that the renderers of all entries may take together."""

Progress = Callable[[float], None]
"""Called with the seconds spent so far."""


@dataclass(frozen=True)
class Subject:
    """A view to time."""

    name: str
    frame: Frame
    instances: Sequence[Instance]
    view: View

    def reels(self, side: int) -> dict[str, Turn]:
        """A head that turns in this view, with each entry's settings, `BALANCED` first."""
        scale = side / math.sqrt(self.view.width * self.view.height)
        width, height = (max(1, round(scale * n)) for n in (self.view.width, self.view.height))
        view = self.view.resized(width, height)
        names = [BALANCED, *(name for name in LADDER if name != BALANCED)]
        return {
            name: Turn(self.frame, self.instances, view, ladder_settings(name)) for name in names
        }

    def bytes(self, side: int) -> int:
        """Memory that the renderers of all entries need together."""
        return sum(
            RenderPlan.of(reel.frame, reel.instances, reel.view, reel.settings).bytes
            for reel in self.reels(side).values()
        )


@dataclass(frozen=True)
class Times:
    """Times of all entries in a view of a size."""

    pixels: int
    base_s: float
    ratios: Mapping[str, Ratio]

    def seconds(self, name: str) -> float:
        """Seconds that a frame takes with an entry's settings."""
        return self.base_s * self.ratios[name].value


def ladder_settings(name: str) -> Settings:
    """The settings of an entry."""
    return changed(Settings(), entry_settings(name))


def measure_times(
    device: ComputeDevice,
    subjects: Sequence[Subject],
    *,
    progress: Progress,
    clock: Callable[[], float] = time.monotonic,
) -> dict[str, list[Times]]:
    """Times of each subject by name, from the smallest size up, at least two.

    It takes `TIMES_S` at most, compiling included, unless the fewest frames of the first two sizes
    take longer.
    """
    start, before_s = clock(), 0.0
    found: dict[str, list[Times]] = {subject.name: [] for subject in subjects}
    for number, side in enumerate(SIDES):
        begun = clock()
        if number >= 2:
            needed = max(subject.bytes(side) for subject in subjects)
            if 4.0 * before_s > start + TIMES_S - begun or needed > MEMORY_SHARE * device.memory:
                break
        for place, subject in enumerate(subjects):
            left = start + TIMES_S * (FIRST_SHARE if number == 0 else 1.0) - clock()
            until = clock() + left / (len(subjects) - place)

            def enough(rounds: int, until: float = until) -> bool:
                progress(clock() - start)
                return rounds >= ROUNDS or clock() > until

            found[subject.name].append(_timed(device, subject.reels(side), enough))
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
    """By entry and view, the mean SSIM of the cuts after each of `SSIM_FRAMES`."""
    chosen = [Combination({"entry": name}, ladder_settings(name)) for name in LADDER]
    curves = run_convergence(
        scene, targets, chosen, SSIM_FRAMES, device=device, seeds=1, progress=progress
    )
    found: dict[str, dict[str, list[float]]] = {name: {} for name in LADDER}
    for (target, name), curve in zip(product(targets, LADDER), curves, strict=True):
        found[name][target.name] = [
            round(fmean(cut.mean for cut in point.ssim_cuts or (point.ssim,)), 4)
            for point in curve.points
        ]
    return found


def tradeoff_of(
    timed: TimedDevice,
    scene: str,
    times: Mapping[str, Sequence[Times]],
    truth: str,
    ssim: Mapping[str, Mapping[str, Sequence[float]]],
    frames: Sequence[int],
) -> Tradeoff:
    """The table of what was measured.

    Parameters
    ----------
    scene, truth : str
        The scenes of `times` and of `ssim`.
    times : mapping of str to sequence of Times
        By view, from the smallest size up.
    ssim : mapping of str to mapping of str to sequence of float
        By entry and view, after each of `frames`.
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
    """The geometric mean over views, the lowest end of their intervals and the highest."""
    mean = math.exp(fmean(math.log(ratio.value) for ratio in of_views))
    low = min(ratio.value if ratio.low is None else ratio.low for ratio in of_views)
    high = max(ratio.value if ratio.high is None else ratio.high for ratio in of_views)
    return [round(value, 3) for value in (mean, low, high)]


def _line(name: str, small: Times, large: Times) -> list[float]:
    """Seconds of a frame without its pixels, and per pixel, neither below 0."""
    few, many = small.seconds(name), large.seconds(name)
    slope = (many - few) / (large.pixels - small.pixels)
    slope = min(max(slope, 0.0), many / large.pixels)
    return [float(f"{many - slope * large.pixels:.4g}"), float(f"{slope:.4g}")]
