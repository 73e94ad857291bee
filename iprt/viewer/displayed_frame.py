"""The picture in a window: development into display pixels, with optional comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.measure import metrics
from iprt.output.display import Bytes, display
from iprt.scene.object_edits import ObjectEdit
from iprt.scene.scene import Scene
from iprt.scene.view_edits import ViewEdit
from iprt.viewer import labels
from iprt.viewer.lens import BUFFERS, ERROR_LEVELS, Lens
from iprt.viewer.motion_quality import Preview
from iprt.viewer.session import Shown
from iprt.viewer.snapshot import Snapshot
from iprt.viewer.truth_reader import TruthReader

Radiance = NDArray[np.float32]
STALE = (
    "the truth shows the scene as it was when the truth was made; objects have been edited since"
)
TURNED = "the truth shows where the view looked when the truth was made; it has been edited since"
OUTDATED = f"{STALE}, says scene.toml: once the truth is made again, remove truth_outdated there"


@dataclass(frozen=True, eq=False)
class DevelopedPicture:
    """A picture developed for display.

    Attributes
    ----------
    pixels : (H, W, 3) uint8
    buffer : str or None
        The displayed auxiliary picture, if any.
    caption : str
        Description of the pixels; empty for the plain picture.
    warning : str
        Reason not to trust a comparison; empty if there is none.
    sides : (str, str) or None
        Names of the pictures left and right of the split; None without a split.
    """

    pixels: Bytes
    buffer: str | None = None
    caption: str = ""
    warning: str = ""
    sides: tuple[str, str] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class DisplayedFrame(DevelopedPicture):
    """The picture in a window.

    Attributes
    ----------
    shown : Shown
        The rendered picture behind it; `shown.picture` is linear.
    preview : Preview or None
        Reductions of quality that hold the requested frame rate; None without any.
    latency_s : float or None
        Seconds from the newest answered input to this picture; None at rest.
    fps : float or None
        Recent pictures per second; None at rest or at the start of a motion.
    """

    shown: Shown
    preview: Preview | None
    latency_s: float | None
    fps: float | None

    def figures(self) -> dict[str, str]:
        """Return size, frames, noise, rate and latency in words; empty ones are unknown."""
        shown, view = self.shown, self.shown.request.view
        return {
            "size": f"{view.width} × {view.height}",
            "frames": f"{shown.frames} of {shown.request.frames} frames",
            "noise": "" if shown.noise is None else f"noise {100.0 * shown.noise:.2g}%",
            "rate": "" if self.fps is None else f"{self.fps:.1f} fps",
            "latency": "" if self.latency_s is None else f"latency {1e3 * self.latency_s:.0f} ms",
        }


class PictureDeveloper:
    """Development of one window's pictures into pixels, for use by one thread at a time.

    Attributes
    ----------
    truth : TruthReader
    scores : int
        Number of scored comparisons; captions change after each.
    """

    def __init__(self) -> None:
        self.truth = TruthReader()
        self._pool = ThreadPoolExecutor(1, "iprt SSIM")
        self._score: tuple[tuple[Radiance, Radiance], Future[float]] | None = None
        self.scores = 0

    def close(self) -> None:
        """Stop scoring."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def develop(
        self,
        scene: Scene,
        name: str | None,
        lens: Lens,
        shown: Shown,
        baseline: Shown | None,
        snapshot: Snapshot | None,
        edits: Sequence[ObjectEdit],
        views: Sequence[ViewEdit] = (),
    ) -> DevelopedPicture:
        """Develop a picture for display.

        Parameters
        ----------
        name : str or None
            Name of the displayed view of the scene.
        baseline : Shown or None
            Newest picture of the compared method.
        snapshot : Snapshot or None
        edits : sequence of ObjectEdit
        views : sequence of ViewEdit
            Edits since the scene's files were read.
        """
        exposure, picture = scene.exposure, shown.picture
        buffer = lens.buffer if lens.buffer in picture.aovs and not lens.error else None
        if buffer is None:
            left, words = lens.develop(picture.color, exposure), labels.PICTURE.name
        else:
            left = lens.color(buffer, picture.aovs[buffer], exposure)
            words = BUFFERS[buffer].name
        if lens.against is None or shown.plain:
            return DevelopedPicture(left, buffer, "" if buffer is None else words)
        other = self._other(scene, name, lens, shown, baseline, snapshot)
        if isinstance(other, str):
            return DevelopedPicture(left, buffer, f"{words}: {other}")
        right = lens.develop(other, exposure)
        if lens.against == "snapshot" and snapshot is not None and buffer is not None:
            if buffer not in snapshot.picture.aovs:
                return DevelopedPicture(left, buffer, f"{words}: the snapshot does not have it")
            right = lens.color(buffer, snapshot.picture.aovs[buffer], exposure)
        pixels = lens.compare(left, right)
        warning = ""
        if lens.against == "truth":
            turned = any(edit.shown_name == name and edit.looks_elsewhere for edit in views)
            warning = TURNED if turned else _warning(scene, name, shown, edits)
        against = labels.comparisons()[lens.against].name
        caption = f"{words} | {against}"
        sides: tuple[str, str] | None = (words, against)
        if lens.error:
            percent = 100 * ERROR_LEVELS / 255
            caption = f"Difference from {against.lower()}, white is {percent:.0f}%"
            sides = None
        # Only pictures have scores, not buffers.
        if not warning and buffer is None:
            score = self._scored(shown, other, exposure)
            caption += "" if score is None else f", SSIM {score:.3f}"
        return DevelopedPicture(pixels, buffer, caption, warning, sides)

    def _other(
        self,
        scene: Scene,
        name: str | None,
        lens: Lens,
        shown: Shown,
        baseline: Shown | None,
        snapshot: Snapshot | None,
    ) -> Radiance | str:
        """Return linear radiance (H, W, 3) of the same view, or the reason why there is none."""
        if lens.against == "input":
            background = shown.picture.aovs.get("background")
            return "the input comes with the next picture" if background is None else background
        if lens.against == "snapshot":
            return "no snapshot is taken" if snapshot is None else snapshot.radiance(shown)
        if lens.method is None:
            return self.truth.picture(scene, name, shown)
        if (
            baseline is None
            or baseline.plain  # while kernels compile, it shows the input
            or baseline.frame != shown.frame
            or baseline.request.view != shown.request.view
            or baseline.request.settings is None
            or baseline.request.settings.method != lens.method
        ):
            return f"{lens.method} is being rendered"
        return baseline.picture.color

    def _scored(self, shown: Shown, other: Radiance, exposure: float) -> float | None:
        """Return SSIM as in `iprt compare`, computed in the background; None if not available."""
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
                return metrics.ssim(*(display(image, exposure) for image in pair))
            finally:
                self.scores += 1

        self._score = pair, self._pool.submit(score)
        return None


def _warning(scene: Scene, name: str | None, shown: Shown, edits: Sequence[ObjectEdit]) -> str:
    """Return a warning if a view's truth shows other objects, placements or materials; else ""."""
    entry = None if name is None else scene.views.get(name)
    if entry is None:
        return ""
    if entry.truth_outdated:
        return OUTDATED
    there = {table.name for table in scene.manifest.objects} | {edit.name for edit in edits}
    wanted = there if shown.request.objects is None else set(shown.request.objects)
    seen = wanted - {edit.name for edit in edits if edit.removed}
    same = seen == set(entry.objects) and seen.isdisjoint(edit.name for edit in edits)
    return "" if same else STALE
