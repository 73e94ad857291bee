"""Comparison of a scene's rendered views with its path-traced truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from iprt.errors import FormatError
from iprt.measure import metrics
from iprt.measure.results import grid_of
from iprt.measure.view_truth import Background, Radiance, Scores, Target, read_target, with_frames
from iprt.output.display import display
from iprt.output.grid import Grid

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings

DIFFERENCE_GAIN = 4.0
"""Factor of `difference`, which makes small errors visible."""


@dataclass(frozen=True)
class Comparison:
    """Scores of one rendered view.

    Attributes
    ----------
    view, method, background : str
        Names of the view, the method and the background.
    ms : dict of str to float
        Milliseconds per frame of each pass, without the passes that run once per video frame.
    bytes : int
        Size of the device's buffers; 0 for a picture from another renderer.
    """

    view: str
    method: str
    background: Background
    scores: Scores
    ms: dict[str, float]
    bytes: int


@dataclass(frozen=True)
class Compared:
    """A comparison with its target and its picture, linear radiance (H, W, 3)."""

    comparison: Comparison
    target: Target
    color: Radiance

    @property
    def render(self) -> metrics.Image:
        """The displayed picture, (H, W, 3) float64 in [0, 1]."""
        return display(self.color, self.target.exposure)

    def panels(self) -> metrics.Image:
        """Join render, truth and their difference side by side, (H, 3W, 3)."""
        render, truth = self.render, self.target.shown
        return np.concatenate([render, truth, difference(render, truth)], axis=1)


def difference(render: metrics.Image, truth: metrics.Image) -> metrics.Image:
    """Compute the absolute difference times `DIFFERENCE_GAIN`, clipped to [0, 1]."""
    return np.clip(DIFFERENCE_GAIN * np.abs(render - truth), 0.0, 1.0)


def compare_views(
    scene: Scene,
    views: Sequence[str],
    variants: Sequence[Settings],
    *,
    device: ComputeDevice,
    background: Background = "panorama",
    frames: int = 64,
    size: tuple[int, int] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Compared]:
    """Render each view with each variant of the settings over `frames` frames, and score it.

    All truths are read and checked before anything is rendered.

    Parameters
    ----------
    views : sequence of str
        See `iprt.measure.view_truth.views_with_truth`.
    background : {"panorama", "truth"}
        Background that the objects are composited over.
    size : (int, int) or None
        Width and height of the pictures; see `read_target`.
    progress : callable, optional
        Called with the number of frames rendered so far.

    Raises
    ------
    IprtError
        A target cannot be read (see `read_target`), or a picture needs more memory than the device
        has.
    """
    targets = [read_target(scene, name, background, size) for name in views]
    done = 0

    def forward(count: int) -> None:
        if progress is not None:
            progress(done + count)

    for target, frame in with_frames(scene, targets):
        for settings in variants:
            drawn = render_target(scene, frame, target, settings, device, frames, forward)
            done += frames
            scores = scored(target, drawn.color, f"method {settings.method}")
            comparison = Comparison(
                target.name, settings.method, background, scores, drawn.ms, drawn.bytes
            )
            yield Compared(comparison, target, drawn.color)


@dataclass(frozen=True)
class Drawn:
    """A linear picture (H, W, 3), milliseconds per frame of each pass, and bytes of buffers."""

    color: Radiance
    ms: dict[str, float]
    bytes: int


def render_target(
    scene: Scene,
    frame: Frame,
    target: Target,
    settings: Settings,
    device: ComputeDevice,
    frames: int,
    progress: Callable[[int], None] | None = None,
) -> Drawn:
    """Render the picture of a target."""
    from iprt.memory import require_memory
    from iprt.renderer import Renderer

    instances = scene.instances_named(target.objects)
    plan = require_memory(device, frame, instances, target.view, settings)
    with Renderer(
        device, frame, instances, target.view, settings, background=target.background
    ) as renderer:
        device.finish()
        device.profile.reset()
        picture = renderer.render(frames=frames, progress=progress)
    profile = device.profile
    ms = {entry.name: entry.ms / profile.frames for entry in profile.passes()}
    return Drawn(picture.color, ms, plan.bytes)


def scored(target: Target, color: Radiance, what: str) -> Scores:
    """Score a picture. `what` describes it in messages, beside the view.

    Raises
    ------
    FormatError
        The picture contains NaN or infinity.
    """
    try:
        return target.score(color)
    except FormatError as problem:
        message = f"{target.scene}: view '{target.name}', {what}: {problem}"
        raise FormatError(message) from problem


def score_grid(results: Sequence[Comparison]) -> Grid:
    """Build a table with one row per view and method.

    `results` has at least one entry, all over the same background.
    """
    lacking = any(result.scores.flip is None for result in results)
    return grid_of(
        f"background: {results[0].background}",
        [
            {
                "view": result.view,
                "method": result.method,
                "SSIM": f"{result.scores.ssim:.4f}",
                "cuts": " ".join(f"{value:.3f}" for value in result.scores.ssim_cuts) or "-",
                "PSNR": f"{result.scores.psnr:.2f}",
                "MSE": f"{result.scores.mse:.1e}",
                "RMSE": f"{result.scores.rmse:.3g}",
                "FLIP": "-" if result.scores.flip is None else f"{result.scores.flip:.4f}",
                "ms": f"{sum(result.ms.values()):.1f}" if result.ms else "-",
                "MB": f"{result.bytes / 1e6:.0f}" if result.bytes else "-",
            }
            for result in results
        ],
        *(["FLIP: pip install 'iprt[metrics]'"] if lacking else []),
        "ms: of a frame, all passes. MB: buffers on the device.",
        words=2,
    )
