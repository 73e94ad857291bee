"""Accuracy and temporal stability of a scene's played video."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from iprt.measure import metrics
from iprt.measure.combinations import Combination, still_settings
from iprt.measure.stability import (
    CAUSES,
    KINDS,
    Cause,
    Flicker,
    FlickerMeter,
    Kind,
    Trail,
    TrailMeter,
    left_behind,
    pixel_kinds,
    taken,
)
from iprt.measure.view_truth import Scores, Target, read_target, reduced_cut, truth_indices
from iprt.output.display import display

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.measure.view_truth import Background
    from iprt.renderer import RenderedFrame
    from iprt.scene.scene import Scene
    from iprt.scene.scene_view import SceneView

SHOWN = ("background", "coverage", "ratio", "gloss", "motion")
CONVERGED = ("coverage", "depth", "ratio")
"""AOVs needed of played pictures (`SHOWN`) and of converged ones."""


@dataclass(frozen=True)
class Stability:
    """Accuracy and stability of one view of a played video.

    Attributes
    ----------
    settings : str
        The swept settings.
    scores : dict of int to Scores
        Scores of the frames that have a truth, by frame index.
    temporal_error : float or None
        RMSE of the frame-to-frame change of the displayed picture against the change of the truth.
        None without truths of consecutive frames.
    flicker : dict of Kind to Flicker
        Flicker with the input, the panorama in this view, as reference.
    true_flicker : dict of Kind to Flicker
        Flicker with the truth as reference, between truths of consecutive frames.
    unequal : int
        Number of pixels that no object changes and that are not bit-identical to the input.
    trails : dict of Cause to Trail
        Ghost trails by cause. Empty if not measured.
    """

    view: str
    settings: str
    scores: Mapping[int, Scores]
    temporal_error: float | None
    flicker: Mapping[Kind, Flicker]
    true_flicker: Mapping[Kind, Flicker]
    unequal: int
    trails: Mapping[Cause, Trail]

    @property
    def worst_flicker(self) -> float:
        """Largest ratio of the flicker of real pixels to the input's, over their kinds."""
        ratios = [self.flicker["untouched"].ratio, self.flicker["relit"].ratio]
        return max((ratio for ratio in ratios if not np.isnan(ratio)), default=1.0)

    def mean(self, score: Callable[[Scores], float]) -> float | None:
        """Average a score over the frames with a truth; None without any."""
        return fmean(map(score, self.scores.values())) if self.scores else None


@dataclass(frozen=True)
class Moment:
    """A displayed frame of the video; images are (H, W, 3) float64 in [0, 1].

    Attributes
    ----------
    index : int
        Frame index.
    shown : tuple of image
        Pictures with each combination of settings.
    converged : image or None
        Picture without noise or temporal lag. None: not requested.
    """

    index: int
    shown: tuple[metrics.Image, ...]
    converged: metrics.Image | None


class Player:
    """Player of one view of a video with several combinations of settings, which measures each.

    Parameters
    ----------
    view : SceneView
        The view at the rendered size.
    chosen : sequence of Combination
        Combinations of settings.
    background : {"panorama", "truth"}
        Background of the scored pictures. Flicker is measured over the panorama.
    converge : int
        Frames accumulated in each converged picture, from which trails are measured. 0: none.
    """

    def __init__(
        self,
        scene: Scene,
        view: SceneView,
        chosen: Sequence[Combination],
        *,
        device: ComputeDevice,
        background: Background = "panorama",
        converge: int = 0,
    ) -> None:
        self._scene, self._view, self._device = scene, view, device
        self._chosen, self._converge = chosen, converge
        self._targets = read_targets(scene, view, background)
        self._meters = [_Meters(scene.exposure) for _ in chosen]

    def play(self, indices: Sequence[int]) -> Iterator[Moment]:
        """Render the frames in order.

        Raises
        ------
        IprtError
            Rendering fails (see `iprt.film.Film.frames`), or a picture contains NaN.
        """
        from iprt.film import Film

        exposure = self._scene.exposure
        with ExitStack() as stack:
            films = [
                stack.enter_context(Film(self._scene, self._device, c.settings, view=self._view))
                for c in self._chosen
            ]
            runs = [film.frames(indices, aovs=SHOWN) for film in films]
            for steps in zip(*runs, strict=True):
                index, pictures = steps[0][0], [picture for _, picture in steps]
                converged = self._converged(index) if self._converge else None
                target = self._targets.get(index)
                for meters, picture in zip(self._meters, pictures, strict=True):
                    meters.add(index, picture, converged, target)
                yield Moment(
                    index,
                    tuple(display(picture.color, exposure) for picture in pictures),
                    None if converged is None else display(converged.color, exposure),
                )

    def _converged(self, index: int) -> RenderedFrame:
        from iprt.film import Film

        settings = still_settings(self._chosen[0].settings, 1)
        with Film(
            self._scene, self._device, settings, view=self._view, accumulate=self._converge
        ) as film:
            ((_, picture),) = film.frames([index], aovs=CONVERGED)
        return picture

    def results(self) -> list[Stability]:
        """Return the results of each combination over the frames played so far."""
        return [
            meters.result(self._view.name, combination.label, measured=self._converge > 0)
            for meters, combination in zip(self._meters, self._chosen, strict=True)
        ]


class _Meters:
    """Meters of one combination of settings."""

    def __init__(self, exposure: float) -> None:
        self._exposure = exposure
        self._input, self._truth = FlickerMeter(), FlickerMeter()
        self._trails = {cause: TrailMeter() for cause in CAUSES}
        self._scores: dict[int, Scores] = {}
        self._errors: list[float] = []
        self._last: tuple[metrics.Image, Target | None] | None = None
        self._last_converged: Mapping[str, NDArray[np.float32]] | None = None
        self._unequal = 0

    def add(
        self,
        index: int,
        picture: RenderedFrame,
        converged: RenderedFrame | None,
        target: Target | None,
    ) -> None:
        """Add the next frame."""
        aovs = _with_ratio(picture)
        shown = display(picture.color, self._exposure)
        given = display(aovs["background"], self._exposure)
        kinds = pixel_kinds(aovs["coverage"], aovs["ratio"], aovs["gloss"])
        differs = (picture.color != aovs["background"]).any(axis=-1)
        self._unequal += int((differs & kinds["untouched"]).sum())
        self._input.add(shown, given, kinds, aovs["motion"])
        truth = None if target is None else target.shown
        self._truth.add(shown, truth, kinds, aovs["motion"])
        if target is not None:
            self._scores[index] = target.score(over_background(picture, target))
        if self._last is not None and target is not None and self._last[1] is not None:
            change, true_change = shown - self._last[0], target.shown - self._last[1].shown
            self._errors.append(float(np.mean((change - true_change) ** 2)))
        self._last = shown, target
        if converged is not None:
            self._add_trail(shown, converged)

    def _add_trail(self, shown: metrics.Image, converged: RenderedFrame) -> None:
        now = _with_ratio(converged)
        left = left_behind(self._last_converged or now, now)
        gone = np.logical_or.reduce(list(left.values()))
        clean = display(converged.color, self._exposure)
        for cause, meter in self._trails.items():
            others = gone & ~left[cause]
            meter.add(shown, clean, left=left[cause], taken=taken(now) | others)
        self._last_converged = now

    def result(self, view: str, label: str, *, measured: bool) -> Stability:
        """Return the results so far, with trails if they were `measured`."""
        return Stability(
            view=view,
            settings=label,
            scores=dict(self._scores),
            temporal_error=float(np.sqrt(fmean(self._errors))) if self._errors else None,
            flicker={kind: self._input.result(kind) for kind in KINDS},
            true_flicker={kind: self._truth.result(kind) for kind in KINDS},
            unequal=self._unequal,
            trails={c: meter.result() for c, meter in self._trails.items()} if measured else {},
        )


def read_targets(scene: Scene, view: SceneView, background: Background) -> dict[int, Target]:
    """Read the truths of a view by frame index, at the size of `view`.

    Raises
    ------
    IprtError
        A truth cannot be read; see `read_target`.
    """
    size = (view.view.width, view.view.height)
    return {
        index: read_target(scene, view.name, background, size, index)
        for index in truth_indices(scene, view.name)
    }


def over_background(picture: RenderedFrame, target: Target) -> NDArray[np.float32]:
    """Composite the picture over the target's background, if it has one (IPRT Eq. 2); linear."""
    if target.background is None:
        return picture.color
    aovs = _with_ratio(picture)
    through = (1.0 - aovs["coverage"])[..., None] * aovs["ratio"]
    over = picture.color + through * (target.background - aovs["background"])
    return np.maximum(over, np.float32(0.0)).astype(np.float32)


def _with_ratio(picture: RenderedFrame) -> dict[str, NDArray[np.float32]]:
    """Return the AOVs, with a ratio of 1 if none was computed."""
    ratio = picture.aovs["ratio"]
    return {**picture.aovs, "ratio": np.ones_like(picture.color) if ratio.ndim == 2 else ratio}


def resized(view: SceneView, size: tuple[int, int] | None) -> SceneView:
    """Return the view at another size (width, height)."""
    if size is None:
        return view
    factor = max(view.view.width // size[0], 1)
    cuts = tuple(reduced_cut(cut, factor) for cut in view.cuts)
    return replace(view, view=view.view.resized(*size), cuts=cuts)
