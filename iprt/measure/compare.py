"""Render a scene's views and score them against its path-traced truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError, SceneError
from iprt.measure import metrics
from iprt.output.table import pass_rows
from iprt.scene.images import read_color
from iprt.scene.source import frame_path

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.scene.frame import Frame
    from iprt.scene.scene import Scene

Method = Literal["iprt", "ibl"]
Background = Literal["panorama", "truth"]
METHODS: tuple[Method, ...] = ("iprt", "ibl")

DIFFERENCE_GAIN = 4.0
"""Factor that makes small differences visible in `panels`."""


@dataclass(frozen=True)
class Comparison:
    """Scores of one rendered view; all metrics are of display-referred images.

    Attributes
    ----------
    view, method, background : str
        What was rendered; `background` tells what the camera sees behind the objects: the
        resampled `panorama`, or the `truth`'s own, which leaves relighting as the only difference.
    ssim : float
        Of the whole view.
    ssim_cuts : tuple of float
        Of the view's cuts, in the order of the manifest.
    psnr : float
        Decibel; inf for equal images.
    mse : float
    flip : float or None
        None where the evaluator is not installed.
    ms : dict of str to float
        Milliseconds per frame of each pass; the panorama's own, once per video frame, apart.
    """

    view: str
    method: Method
    background: Background
    ssim: float
    ssim_cuts: tuple[float, ...]
    psnr: float
    mse: float
    flip: float | None
    ms: dict[str, float]

    def record(self) -> dict[str, object]:
        """The same as plain data; `psnr` is None for equal images, as JSON has no infinity."""
        return {
            "view": self.view,
            "method": self.method,
            "background": self.background,
            "ssim": self.ssim,
            "ssim_cuts": list(self.ssim_cuts),
            "psnr": self.psnr if math.isfinite(self.psnr) else None,
            "mse": self.mse,
            "flip": self.flip,
            "ms": dict(self.ms),
        }


@dataclass(frozen=True)
class Compared:
    """A comparison with its two display-referred images, (H, W, 3) float64 in [0, 1]."""

    comparison: Comparison
    render: metrics.Image
    truth: metrics.Image

    def panels(self) -> metrics.Image:
        """(H, 3W, 3): render, truth, and their absolute difference times `DIFFERENCE_GAIN`."""
        difference = np.clip(DIFFERENCE_GAIN * np.abs(self.render - self.truth), 0.0, 1.0)
        return np.concatenate([self.render, self.truth, difference], axis=1)


@dataclass(frozen=True)
class _Truth:
    """What a view is compared with: display-referred, of the frame `index` of the video."""

    index: int
    shown: metrics.Image
    background: NDArray[np.float32] | None


def views_with_truth(scene: Scene, view: str | None = None) -> list[str]:
    """Names of the views that can be compared: `view`, or all that have a truth.

    Raises
    ------
    SceneError
        The view is unknown or has no truth, or no view of the scene has one.
    """
    if view is not None:
        if view not in scene.views:
            known = ", ".join(scene.views) or "none"
            raise SceneError(f"{scene.name}: no view is named '{view}'; the views are: {known}")
        if scene.views[view].truth is None:
            raise SceneError(
                f"{scene.name}: views.{view}.truth is not set, so there is nothing to compare with"
            )
        return [view]
    names = [name for name, entry in scene.views.items() if entry.truth is not None]
    if not names:
        raise SceneError(
            f"{scene.name}: no view has a truth to compare with; "
            "render one with `iprt reference` and name it in views.<name>.truth"
        )
    return names


def compare_views(
    scene: Scene,
    views: Sequence[str],
    methods: Sequence[Method],
    *,
    device: ComputeDevice,
    background: Background = "panorama",
    frames: int = 64,
    seed: int = 0,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Compared]:
    """Render each view with each method, accumulating `frames` frames, and score it.

    Truths are read, and faults in them reported, before anything is rendered. Of a video, a view
    is compared at the first frame that has a truth.

    Parameters
    ----------
    views : sequence of str
        See `views_with_truth`.
    background : {"panorama", "truth"}
        Which background the objects are composited over.
    progress : callable, optional
        Called with the number of frames of the current picture done so far.

    Raises
    ------
    SceneError
        A file of a truth is not set or missing.
    FormatError
        Sizes differ, a cut does not suit, or a picture holds NaN or infinity.
    DeviceError
        A picture needs more memory than the device has.
    """
    truths = {name: _read_truth(scene, name, background) for name in views}
    frames_read: dict[int, Frame] = {}
    for name in views:
        index = truths[name].index
        if index not in frames_read:
            frames_read = {index: scene.frame(index)}
        for method in methods:
            yield _compare_view(
                scene,
                frames_read[index],
                name,
                method,
                truths[name],
                device=device,
                background=background,
                frames=frames,
                seed=seed,
                progress=progress,
            )


def _compare_view(
    scene: Scene,
    frame: Frame,
    name: str,
    method: Method,
    truth: _Truth,
    *,
    device: ComputeDevice,
    background: Background,
    frames: int,
    seed: int,
    progress: Callable[[int], None] | None,
) -> Compared:
    from iprt.memory import require_memory
    from iprt.renderer import Renderer
    from iprt.settings import Settings

    entry = scene.views[name]
    # Nothing moves, so the mean of all frames is the best picture: no fading.
    settings = Settings(method=method, seed=seed, fading=0.0)
    instances = scene.instances_named(entry.objects)
    require_memory(device, frame, instances, entry.view, settings)
    with Renderer(
        device, frame, instances, entry.view, settings, background=truth.background
    ) as renderer:
        device.finish()
        device.profile.reset()
        picture = renderer.render(frames=frames, progress=progress)
    try:
        shown = metrics.display(picture.color, scene.exposure)
        comparison = Comparison(
            view=name,
            method=method,
            background=background,
            ssim=metrics.ssim(shown, truth.shown),
            ssim_cuts=metrics.ssim_cuts(shown, truth.shown, entry.cuts),
            psnr=metrics.psnr(shown, truth.shown),
            mse=metrics.mse(shown, truth.shown),
            flip=metrics.flip(shown, truth.shown),
            ms={row.name: row.ms for row in pass_rows(device.profile)},
        )
    except FormatError as problem:
        raise FormatError(f"{scene.name}: view '{name}', method {method}: {problem}") from problem
    return Compared(comparison, shown, truth.shown)


def _read_truth(scene: Scene, name: str, background: Background) -> _Truth:
    """Read a view's truth and check all that can be checked before rendering."""
    entry = scene.views[name]
    try:
        metrics.check_cuts(entry.cuts, entry.view.width, entry.view.height)
    except FormatError as error:
        raise FormatError(f"{scene.name}: views.{name}.cuts: {error}") from error
    index, radiance = _read_picture(scene, name, "truth", entry.truth)
    behind = None
    if background == "truth":
        _, behind = _read_picture(scene, name, "truth_background", entry.truth_background, index)
    return _Truth(index, metrics.display(radiance, scene.exposure), behind)


def _read_picture(
    scene: Scene, name: str, key: str, path: Path | None, index: int | None = None
) -> tuple[int, NDArray[np.float32]]:
    """The picture of frame `index`, or else of the first frame that has one, and that frame."""
    if path is None:
        raise SceneError(f"{scene.name}: views.{name}.{key} is not set")
    pattern = str(path.relative_to(scene.root))
    indices = scene.frame_indices if index is None else [index]
    files = [(i, frame_path(scene.root, pattern, i)) for i in indices]
    found = next(((i, file) for i, file in files if file.is_file()), None)
    if found is None:
        raise SceneError(f"{scene.name}: views.{name}.{key}: there is no file {files[0][1]}")
    radiance: NDArray[np.float32] = read_color(found[1])
    view = scene.views[name].view
    if radiance.shape != (view.height, view.width, 3):
        raise FormatError(
            f"{found[1]}: {radiance.shape[1]}x{radiance.shape[0]} pixels, "
            f"but views.{name}.size is {view.width}x{view.height}"
        )
    if not np.isfinite(radiance).all():
        raise FormatError(f"{found[1]}: holds NaN or infinite radiance; render it again")
    return found[0], radiance
