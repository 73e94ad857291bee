"""From a rendered picture to the pixels that a window shows, compared with others on demand."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from iprt.measure import metrics
from iprt.scene.scene import Scene
from iprt.viewer.lens import ERROR_LEVELS, Lens
from iprt.viewer.session import Shown
from iprt.viewer.tone import Bytes
from iprt.viewer.truth import Truth

Radiance = NDArray[np.float32]
NAMES = {"input": "input", "ibl": "IBL", "truth": "truth"}


class Developer:
    """Makes one window's pixels. One thread at a time may use it.

    Attributes
    ----------
    truth : Truth
    scores : int
        How many comparisons have been scored: captions tell more after each.
    """

    def __init__(self) -> None:
        self.truth = Truth()
        self._pool: ThreadPoolExecutor | None = None
        self._score: tuple[tuple[Radiance, Radiance], Future[float]] | None = None
        self._done = 0

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)

    @property
    def scores(self) -> int:
        return self._done

    def develop(
        self, scene: Scene, name: str | None, lens: Lens, shown: Shown, baseline: Shown | None
    ) -> tuple[Bytes, str]:
        """The pixels, (H, W, 3) uint8, and what they are compared with, in words.

        Parameters
        ----------
        name : str or None
            Of the scene's view that is shown.
        baseline : Shown or None
            The newest picture of the method `ibl`.
        """
        exposure, picture = scene.exposure, shown.picture
        values = None if lens.buffer is None else picture.aovs.get(lens.buffer)
        if lens.buffer is not None and values is not None and not lens.error:
            left = lens.color(lens.buffer, values, exposure)
        else:
            left = lens.develop(picture.color, exposure)
        if lens.against is None:
            return left, ""
        other = self._other(scene, name, lens, shown, baseline)
        if isinstance(other, str):
            return left, other
        pixels = lens.compare(left, lens.develop(other, exposure))
        return pixels, self._caption(lens, shown, other, exposure)

    def _other(
        self, scene: Scene, name: str | None, lens: Lens, shown: Shown, baseline: Shown | None
    ) -> Radiance | str:
        """Linear radiance (H, W, 3) of the same view; or why there is none."""
        if lens.against == "input":
            background = shown.picture.aovs.get("background")
            return "the input comes with the next picture" if background is None else background
        if lens.against == "ibl":
            if (
                baseline is None
                or baseline.frame != shown.frame
                or baseline.request.view != shown.request.view
            ):
                return "IBL is being rendered"
            return baseline.picture.color
        if name is None:
            return "only the scene's own views have a truth: go to one"
        return self.truth.picture(scene, name, shown)

    def _caption(self, lens: Lens, shown: Shown, other: Radiance, exposure: float) -> str:
        assert lens.against is not None
        name = NAMES[lens.against]
        if lens.error:
            words = f"difference to {name}: white is {100 * ERROR_LEVELS / 255:.0f} %"
        else:
            words = f"{lens.buffer or 'iprt'} | {name}"
        score = self._scored(shown, other, exposure)
        return words if score is None else f"{words}   SSIM {score:.3f}"

    def _scored(self, shown: Shown, other: Radiance, exposure: float) -> float | None:
        """SSIM as `iprt compare` has it, computed beside; None: not yet, or too small for it."""
        if not shown.refined or min(other.shape[:2]) < metrics.SSIM_WINDOW:
            return None
        pair = shown.picture.color, other
        if self._score is not None:
            (ours, theirs), future = self._score
            if not future.done():
                return None
            if ours is pair[0] and theirs is pair[1]:
                return future.result() if future.exception() is None else None

        def score() -> float:
            try:
                return metrics.ssim(*(metrics.display(image, exposure) for image in pair))
            finally:
                self._done += 1

        if self._pool is None:
            self._pool = ThreadPoolExecutor(1, "iprt SSIM")
        self._score = pair, self._pool.submit(score)
        return None
