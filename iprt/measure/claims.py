"""Claims of papers, measured on a scene's views with truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from iprt.measure import metrics
from iprt.measure.bench import timed_together
from iprt.measure.camera_motion import Turn
from iprt.measure.combinations import still_settings
from iprt.measure.compare import render_target, scored
from iprt.measure.intervals import Ratio
from iprt.measure.learned_accuracy import LearnedAccuracy, learn_frame
from iprt.measure.measurement import Measurement
from iprt.measure.results import grid_of
from iprt.measure.view_truth import Radiance, Scores, Target, with_frames
from iprt.output.display import display
from iprt.output.grid import Grid
from iprt.settings.overrides import Assignment, changed, resolved
from iprt.settings.trace import LearningSettings

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.geometry.mesh import Instance
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings

Values = Mapping[str, Any]
"""Settings by dotted key, including the method."""
NEAR = 0.04
"""Largest distance of pixels near an object, as a share of the picture's height."""
SEEN = 0.02
"""Least visible difference of displayed values."""


@dataclass(frozen=True)
class Finding:
    """The measurement of a claim.

    Attributes
    ----------
    measured : str
        The figures, as text.
    holds : bool
        The claim holds.
    """

    measured: str
    holds: bool


@dataclass(frozen=True)
class Claim:
    """A claim of a paper.

    Attributes
    ----------
    paper, text : str
        Name of the paper, and the claim.
    published : str
        The paper's figures, if any, and the device used.
    measure : callable
        Measures the claim on a view.
    unless : str
        The reason why it may not hold here.
    """

    paper: str
    text: str
    published: str
    measure: Callable[[ClaimView], Finding]
    unless: str


@dataclass(frozen=True)
class Verdict:
    """The result of a claim on a view. `why`: the reason if it does not hold; else empty."""

    paper: str
    claim: str
    published: str
    view: str
    measured: str
    holds: bool
    why: str

    @classmethod
    def of(cls, claim: Claim, view: str, found: Finding) -> Verdict:
        """Build the verdict from a measurement."""
        why = "" if found.holds else claim.unless
        return cls(claim.paper, claim.text, claim.published, view, found.measured, found.holds, why)


@dataclass
class ClaimView:
    """A view to measure on. Each combination of settings is rendered once.

    Attributes
    ----------
    frames : int
        Number of timed frames, and of frames accumulated in a picture.
    """

    scene: Scene
    target: Target
    frame: Frame
    device: ComputeDevice
    frames: int
    _pictures: dict[str, Radiance] = field(default_factory=dict)

    @property
    def _instances(self) -> tuple[Instance, ...]:
        return self.scene.instances_named(self.target.objects)

    def times(self, *variants: Values) -> list[list[float]]:
        """Time interleaved frames of each variant while the view turns; milliseconds."""
        view, instances = self.target.view, self._instances
        reels = [Turn(self.frame, instances, view, _settings(v)) for v in variants]
        return timed_together(self.device, reels, lambda count: count >= self.frames)

    def ratio(self, values: Values, base: Values) -> Ratio:
        """Measure the ratio of frame times, `values` over `base`."""
        times, others = self.times(values, base)
        return Ratio.of(times, others)

    def picture(self, values: Values) -> Radiance:
        """Render the view; linear radiance (H, W, 3)."""
        settings = still_settings(_settings(values), 0)
        key = settings.model_dump_json()
        if key not in self._pictures:
            self._pictures[key] = render_target(
                self.scene, self.frame, self.target, settings, self.device, self.frames
            ).color
        return self._pictures[key]

    def scores(self, values: Values) -> Scores:
        """Score the picture against the truth."""
        return scored(self.target, self.picture(values), str(dict(values)))

    def errors(self, values: Values) -> tuple[float, float]:
        """Measure the error of real surfaces that objects change visibly.

        Returns
        -------
        near, far : float
            Mean absolute errors of displayed values: of pixels within `NEAR` of an object in the
            picture, and of all others.
        """
        target = self.target
        truth = target.shown
        shown, plain = (
            display(self.picture(v), target.exposure) for v in (values, {"method": "ibl"})
        )
        away = distance_transform_edt(self._coverage() == 0.0)
        # Image-based lighting does not change real surfaces.
        changed = (np.abs(truth - plain).max(axis=-1) > SEEN) & (away > 0.0)
        near = away <= NEAR * len(truth)
        error = np.abs(shown - truth).mean(axis=-1)
        return float(error[changed & near].mean()), float(error[changed & ~near].mean())

    def _coverage(self) -> NDArray[np.float32]:
        """Render the coverage of each pixel by objects, (H, W) in [0, 1]."""
        from iprt.renderer import Renderer

        view, settings = self.target.view, still_settings(_settings({"method": "ibl"}), 0)
        with Renderer(self.device, self.frame, self._instances, view, settings) as renderer:
            return renderer.render(1, ["coverage"]).aovs["coverage"]

    @cached_property
    def learned(self) -> LearnedAccuracy:
        """The radiance models that `oil` learns of the panorama in `frames` frames."""
        own, exposure = LearningSettings(), self.target.exposure
        return learn_frame(self.device, self.frame, own, self.frames, exposure)

    def likeness(self, values: Values, other: Values) -> float:
        """Compute the SSIM of two displayed pictures."""
        exposure = self.target.exposure
        return metrics.ssim(*(display(self.picture(v), exposure) for v in (values, other)))


def _settings(values: Values) -> Settings:
    method = [Assignment("method", values["method"], "a claim")]
    return changed(resolved("balanced", method), values)


def run_claims(
    plan: Measurement,
    claims: Sequence[Claim],
    frames: int,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Verdict]:
    """Measure every claim on every view.

    Parameters
    ----------
    frames : int
        Number of timed and accumulated frames; see `ClaimView`.
    progress : callable, optional
        Called with the number of claims measured so far.
    """
    done = 0
    for target, frame in with_frames(plan.scene, plan.targets):
        view = ClaimView(plan.scene, target, frame, plan.device, frames)
        for claim in claims:
            yield Verdict.of(claim, target.name, claim.measure(view))
            done += 1
            if progress is not None:
                progress(done)


def claims_grid(verdicts: Sequence[Verdict]) -> Grid:
    """Build a table with a row per claim and view."""
    return grid_of(
        "Claims of papers",
        [
            {
                "paper": verdict.paper,
                "claim": verdict.claim,
                "published": verdict.published,
                "view": verdict.view,
                "here": verdict.measured,
                "holds": "yes" if verdict.holds else "no",
                "why not": verdict.why,
            }
            for verdict in verdicts
        ],
        words=7,
    )
