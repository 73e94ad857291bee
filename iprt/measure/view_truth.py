"""Path-traced truth of a view, and scores of pictures against it."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError, IprtError, SceneError
from iprt.files.images import read_color
from iprt.footage.video.picture_tracks import frame_path
from iprt.measure import metrics
from iprt.measure.intervals import Estimate
from iprt.output.display import display

if TYPE_CHECKING:
    from iprt.footage.frame import Frame
    from iprt.geometry.camera import View
    from iprt.scene.scene import Scene

LOG = logging.getLogger("iprt.measure")
Radiance = NDArray[np.float32]
Background = Literal["panorama", "truth"]
"""Background behind the objects: the resampled panorama, or the truth's own background, over which
relighting is the only difference."""


@dataclass(frozen=True)
class Scores:
    """Scores of a picture against the truth, of display-referred images except for `rmse`.

    Attributes
    ----------
    ssim : float
        SSIM of the whole view.
    ssim_cuts : tuple of float
        SSIM of the view's cuts, in the order of the manifest.
    psnr : float
        PSNR in dB; inf for equal images.
    mse : float
        Mean squared error.
    rmse : float
        Root mean squared error of linear radiance.
    flip : float or None
        Mean FLIP error. None if the evaluator is not installed.
    """

    ssim: float
    ssim_cuts: tuple[float, ...]
    psnr: float
    mse: float
    rmse: float
    flip: float | None

    @property
    def cuts(self) -> tuple[float, ...]:
        """SSIM of each cut, or of the whole view if it has none."""
        return self.ssim_cuts or (self.ssim,)


@dataclass(frozen=True)
class ScoreEstimates:
    """Scores of a view over several pictures; see `Scores`."""

    ssim: Estimate
    ssim_cuts: tuple[Estimate, ...]
    rmse: Estimate
    flip: Estimate | None

    @classmethod
    def of(cls, scores: Sequence[Scores]) -> ScoreEstimates:
        """Estimate from the scores of at least one picture."""
        flips = [score.flip for score in scores if score.flip is not None]
        return cls(
            ssim=Estimate.of([score.ssim for score in scores]),
            ssim_cuts=tuple(
                map(Estimate.of, zip(*(score.ssim_cuts for score in scores), strict=True))
            ),
            rmse=Estimate.of([score.rmse for score in scores]),
            flip=Estimate.of(flips) if flips else None,
        )

    @property
    def cuts(self) -> tuple[Estimate, ...]:
        """SSIM of each cut, or of the whole view if it has none."""
        return self.ssim_cuts or (self.ssim,)

    @property
    def accuracy(self) -> float:
        """Mean of `cuts`."""
        return fmean(cut.mean for cut in self.cuts)

    def cells(self) -> dict[str, str]:
        """Return the SSIM of the cuts and of the view as cells of a table, by column."""
        named = {f"SSIM cut {number}": cut for number, cut in enumerate(self.ssim_cuts, start=1)}
        return {column: ssim.text() for column, ssim in {**named, "SSIM": self.ssim}.items()}


@dataclass(frozen=True)
class Target:
    """A view with its truth, against which pictures are scored.

    Attributes
    ----------
    index : int
        Video frame of the truth.
    objects : tuple of str
        Names of the objects in the truth.
    radiance : (H, W, 3) float32
        Linear radiance of the truth.
    background : (H, W, 3) float32 or None
        Background to composite over. None: the panorama.
    cuts : tuple of (x0, y0, x1, y1)
        Crops around the objects, in pixels of `view`.
    """

    scene: str
    name: str
    index: int
    view: View
    objects: tuple[str, ...]
    exposure: float
    radiance: Radiance
    background: Radiance | None
    cuts: tuple[metrics.Cut, ...]

    @cached_property
    def shown(self) -> metrics.Image:
        """The displayed truth, (H, W, 3) in [0, 1]."""
        return display(self.radiance, self.exposure)

    def score(self, color: Radiance) -> Scores:
        """Score linear radiance (H, W, 3).

        Raises
        ------
        FormatError
            The radiance contains NaN or infinity.
        """
        shown, truth = display(color, self.exposure), self.shown
        return Scores(
            ssim=metrics.ssim(shown, truth),
            ssim_cuts=metrics.ssim_cuts(shown, truth, self.cuts),
            psnr=metrics.psnr(shown, truth),
            mse=metrics.mse(shown, truth),
            rmse=metrics.rmse(color, self.radiance),
            flip=metrics.flip(shown, truth),
        )


def views_with_truth(scene: Scene, names: Sequence[str] = ()) -> list[str]:
    """Return the names of comparable views: `names`, or all views with a truth.

    Raises
    ------
    SceneError
        A view is unknown or has no truth, or no view of the scene has one.
    """
    for name in names:
        if name not in scene.views:
            known = ", ".join(scene.views) or "none"
            raise SceneError(f"{scene.name}: no view is named '{name}'; the views are: {known}")
        if scene.views[name].truth is None:
            raise SceneError(
                f"{scene.name}: views.{name}.truth is not set, so there is nothing to compare with"
            )
    found = list(names) or [name for name, entry in scene.views.items() if entry.truth is not None]
    if not found:
        raise SceneError(
            f"{scene.name}: no view has a truth to compare with; "
            "render one with `iprt reference` and name it in views.<name>.truth"
        )
    for name in found:
        if (warning := scene.views[name].truth_warning) is not None:
            LOG.warning(warning)
    return found


def truth_indices(scene: Scene, name: str) -> list[int]:
    """Return the video frames for which a view has a truth."""
    path = scene.views[name].truth
    if path is None:
        return []
    pattern = str(path.relative_to(scene.root))
    return [i for i in scene.frame_indices if frame_path(scene.root, pattern, i).is_file()]


def read_target(
    scene: Scene,
    name: str,
    background: Background,
    size: tuple[int, int] | None = None,
    index: int | None = None,
) -> Target:
    """Read a view's truth and validate it before rendering.

    Parameters
    ----------
    size : (int, int) or None
        Width and height of the comparison. The truth is averaged over blocks of whole pixels.
    index : int or None
        Frame of a video. None: the first one with a truth.

    Raises
    ------
    SceneError
        A file of the truth is not set or missing.
    FormatError
        Sizes differ, a cut is invalid, or a picture contains NaN or infinity.
    IprtError
        `size` does not divide the size of the truth.
    """
    entry = scene.views[name]
    factor = _reduction(entry.view, name, size)
    view = entry.view.resized(entry.view.width // factor, entry.view.height // factor)
    cuts = tuple(reduced_cut(cut, factor) for cut in entry.cuts)
    try:
        metrics.check_cuts(entry.cuts, entry.view.width, entry.view.height)
        metrics.check_cuts(cuts, view.width, view.height)
    except FormatError as error:
        raise FormatError(f"{scene.name}: views.{name}.cuts: {error}") from error
    index, radiance = _read_picture(scene, name, "truth", entry.truth, index)
    behind = None
    if background == "truth":
        _, behind = _read_picture(scene, name, "truth_background", entry.truth_background, index)
        behind = _reduced(behind, factor)
    return Target(
        scene=scene.name,
        name=name,
        index=index,
        view=view,
        objects=entry.objects,
        exposure=scene.exposure,
        radiance=_reduced(radiance, factor),
        background=behind,
        cuts=cuts,
    )


def with_frames(scene: Scene, targets: Sequence[Target]) -> Iterator[tuple[Target, Frame]]:
    """Yield each target with its video frame. Consecutive targets of one frame share it."""
    index, frame = None, None
    for target in targets:
        if frame is None or target.index != index:
            index, frame = target.index, scene.frame(target.index)
        yield target, frame


def _reduction(view: View, name: str, size: tuple[int, int] | None) -> int:
    """Return the reduction factor from the truth's size to `size` along a side."""
    if size is None:
        return 1
    width, height = size
    factor = view.width // width if width > 0 else 0
    if factor < 1 or (factor * width, factor * height) != (view.width, view.height):
        raise IprtError(
            f"--size {width} {height}: the truth of view '{name}' has {view.width} x {view.height} "
            "pixels; give it divided by a whole number"
        )
    return factor


def _reduced(image: Radiance, factor: int) -> Radiance:
    """Average blocks of `factor` x `factor` pixels (box filter)."""
    height, width = image.shape[0] // factor, image.shape[1] // factor
    blocks = image.reshape(height, factor, width, factor, 3)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float64).astype(np.float32))


def reduced_cut(cut: metrics.Cut, factor: int) -> metrics.Cut:
    """Scale a cut down by `factor`, rounded outwards to whole pixels."""
    x0, y0, x1, y1 = cut
    return x0 // factor, y0 // factor, -(-x1 // factor), -(-y1 // factor)


def _read_picture(
    scene: Scene, name: str, key: str, path: Path | None, index: int | None = None
) -> tuple[int, Radiance]:
    """Read the picture of frame `index`, or of the first frame that has one.

    Returns the frame index with the picture.
    """
    if path is None:
        raise SceneError(f"{scene.name}: views.{name}.{key} is not set")
    pattern = str(path.relative_to(scene.root))
    indices = scene.frame_indices if index is None else [index]
    files = [(i, frame_path(scene.root, pattern, i)) for i in indices]
    found = next(((i, file) for i, file in files if file.is_file()), None)
    if found is None:
        raise SceneError(f"{scene.name}: views.{name}.{key}: there is no file {files[0][1]}")
    radiance: Radiance = read_color(found[1])
    view = scene.views[name].view
    if radiance.shape != (view.height, view.width, 3):
        raise FormatError(
            f"{found[1]}: {radiance.shape[1]}x{radiance.shape[0]} pixels, "
            f"but views.{name}.size is {view.width}x{view.height}"
        )
    if not np.isfinite(radiance).all():
        raise FormatError(f"{found[1]}: holds NaN or infinite radiance; render it again")
    return found[0], radiance
