"""Claims of the papers whose methods are installed, measured on a scene's views with truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from iprt.measure import metrics
from iprt.measure.bench import timed_together
from iprt.measure.camera_motion import Turn
from iprt.measure.compare import render_target, scored
from iprt.measure.intervals import Ratio
from iprt.measure.learned import Learned, learn_frame
from iprt.measure.sweep import still_settings
from iprt.measure.target import Radiance, Scores, Target, with_frames
from iprt.methods.oil import OilSettings
from iprt.output.display import display
from iprt.output.grid import Grid
from iprt.settings.overrides import Assignment, changed, resolved

if TYPE_CHECKING:
    from iprt.device.compute import ComputeDevice
    from iprt.footage.frame import Frame
    from iprt.scene.scene import Scene
    from iprt.settings.model import Settings

Values = Mapping[str, Any]
"""Settings by dotted key, a method among them."""

IPRT = "IPRT (Wu and Wang 2023)"
DPT = "DPT (Xu et al. 2023)"
NEI = "NEI (Rohmer et al. 2017)"
OIL = "OIL (Lee et al. 2022)"


@dataclass(frozen=True)
class Found:
    """What was measured of a claim.

    Attributes
    ----------
    measured : str
        The figures.
    holds : bool
    """

    measured: str
    holds: bool


@dataclass(frozen=True)
class Claim:
    """What a paper says.

    Attributes
    ----------
    published : str
        The paper's figures, where it has them, and the device that they were measured on.
    measure : callable
        Measures it on a view.
    unless : str
        Why it may not hold here.
    """

    paper: str
    text: str
    published: str
    measure: Callable[[Subject], Found]
    unless: str


@dataclass(frozen=True)
class Verdict:
    """A claim on a view."""

    claim: Claim
    view: str
    found: Found

    def record(self) -> dict[str, object]:
        """The same as plain data."""
        claim = self.claim
        return {
            "paper": claim.paper,
            "claim": claim.text,
            "published": claim.published,
            "view": self.view,
            **asdict(self.found),
            "why": "" if self.found.holds else claim.unless,
        }


class Subject:
    """A view to measure on; pictures are made once for each of the settings.

    Parameters
    ----------
    frames : int
        Frames that are timed, and that pictures accumulate.
    """

    def __init__(
        self, scene: Scene, target: Target, frame: Frame, device: ComputeDevice, frames: int
    ) -> None:
        self._scene, self._target, self._frame = scene, target, frame
        self._device, self._frames = device, frames
        self._pictures: dict[str, Radiance] = {}
        self._learned: Learned | None = None

    def times(self, *variants: Values) -> list[list[float]]:
        """Milliseconds of the frames of each, which take turns while a head turns slowly."""
        instances = self._scene.instances_named(self._target.objects)
        reels = [Turn(self._frame, instances, self._target.view, _settings(v)) for v in variants]
        return timed_together(self._device, reels, lambda count: count >= self._frames)

    def ratio(self, values: Values, base: Values) -> Ratio:
        """Of the times of frames."""
        times, others = self.times(values, base)
        return Ratio.of(times, others)

    def picture(self, values: Values) -> Radiance:
        """Linear radiance (H, W, 3)."""
        settings = still_settings(_settings(values), 0)
        key = settings.model_dump_json()
        if key not in self._pictures:
            self._pictures[key], _ = render_target(
                self._scene, self._frame, self._target, settings, self._device, self._frames
            )
        return self._pictures[key]

    def scores(self, values: Values) -> Scores:
        """Of the picture, against the truth."""
        return scored(self._target, self.picture(values), str(dict(values)))

    def learned(self) -> Learned:
        """What `oil` learns of the panorama in as many frames as are timed."""
        if self._learned is None:
            exposure = self._target.exposure
            self._learned = learn_frame(
                self._device, self._frame, OilSettings(), self._frames, exposure
            )
        return self._learned

    def likeness(self, values: Values, other: Values) -> float:
        """SSIM of two pictures as displayed."""
        exposure = self._target.exposure
        return metrics.ssim(*(display(self.picture(v), exposure) for v in (values, other)))


def _settings(values: Values) -> Settings:
    method = [Assignment("method", values["method"], "a claim")]
    return changed(resolved("balanced", method), values)


def cuts(scores: Scores) -> tuple[float, ...]:
    """SSIM of the cuts, or of a view without any."""
    return scores.ssim_cuts or (scores.ssim,)


# What is measured ------------------------------------------------------------------------------


def _faster(subject: Subject, *, surfaces: str, bounces: Sequence[int], least: float) -> Found:
    ratios = []
    for count in bounces:
        delta, one_pass = (_paths(method, surfaces, count) for method in ("dpt", "pt-diff"))
        ratios.append(subject.ratio(one_pass, delta))
    measured = ", ".join(f"{r.value:.2f}x at {n}" for n, r in zip(bounces, ratios, strict=True))
    return Found(f"{measured} (surfaces={surfaces})", min(r.value for r in ratios) >= least)


def _paths(method: str, surfaces: str, bounces: int) -> dict[str, Any]:
    return {"method": method, f"{method}.surfaces": surfaces, f"{method}.bounces": bounces}


def _as_exact(subject: Subject) -> Found:
    delta, one_pass = (
        subject.scores({"method": name, f"{name}.surfaces": "all"}).rmse
        for name in ("dpt", "pt-diff")
    )
    holds = abs(delta / one_pass - 1.0) < 0.05
    return Found(f"RMSE {delta:.4g} and {one_pass:.4g} (surfaces=all)", holds)


def _linear(subject: Subject) -> Found:
    counts = (3, 5, 7, 10)
    times = [median(t) for t in subject.times(*(_paths("dpt", "all", n) for n in counts))]
    slope, start = np.polyfit(counts, times, 1)
    off = np.abs(np.polyval([slope, start], counts) - times).max() / times[0]
    measured = ", ".join(f"{t:.1f} ms at {n}" for n, t in zip(counts, times, strict=True))
    return Found(f"{measured}: {100 * off:.0f}% off a line (surfaces=all)", bool(off < 0.05))


def _sampling(subject: Subject) -> Found:
    mixed = _paths("dpt", "all", 3)
    ratio = subject.ratio(mixed, {**mixed, "trace.light_sampling": False})
    return Found(f"{100 * (ratio.value - 1):+.0f}% (surfaces=all)", ratio.value < 1.05)


def _above_ibl(subject: Subject) -> Found:
    ours, ibl = (cuts(subject.scores({"method": name})) for name in ("iprt2023", "ibl"))
    pairs = list(zip(ours, ibl, strict=True))
    measured = ", ".join(f"{a:.3f} against {b:.3f}" for a, b in pairs)
    return Found(measured, all(a > b for a, b in pairs))


def _sparse(subject: Subject) -> Found:
    dense = {"method": "iprt2023", "mask.sparse": False}
    sparse = {"method": "iprt2023", "mask.sparse": True}
    saved = 1.0 - subject.ratio(sparse, dense).value
    alike = subject.likeness(sparse, dense)
    return Found(f"{100 * saved:.0f}% less time, SSIM {alike:.3f}", saved > 0.0 and alike > 0.96)


def _back_faces(subject: Subject) -> Found:
    found, without = (
        cuts(subject.scores({"method": "iprt2023", "trace.back_faces": on})) for on in (True, False)
    )
    pairs = list(zip(found, without, strict=True))
    measured = ", ".join(f"{a:.4f} against {b:.4f}" for a, b in pairs)
    return Found(measured, math.fsum(found) > math.fsum(without))


def _impostor_costs(subject: Subject) -> Found:
    rays = {"trace.rays": 16, "trace.object_rays": 16}
    impostor = {"method": "dit", "dit.directions": "boxes", **rays}
    ratio = subject.ratio(impostor, {"method": "em", **rays})
    return Found(f"{ratio.value:.2f}x at 16 samples, of whole frames", 1.0 < ratio.value < 1.5)


def _cache_costs(subject: Subject) -> Found:
    """What a direction more costs, which leaves out all else in the frame."""
    few, many = 32, 128
    cost = {}
    for way in ("cached", "all"):
        of = {"method": "dit", "dit.directions": way}
        times = subject.times(*({**of, "trace.rays": n} for n in (few, many)))
        first, last = (median(t) for t in times)
        cost[way] = (last - first) / (many - few)
    measured = f"{cost['cached']:.3f} ms a direction with the cache, {cost['all']:.3f} without"
    return Found(measured, cost["cached"] < 0.9 * cost["all"])


def _above_em(subject: Subject) -> Found:
    ours, em = (cuts(subject.scores({"method": name})) for name in ("dit", "em"))
    pairs = list(zip(ours, em, strict=True))
    measured = ", ".join(f"{a:.3f} against {b:.3f}" for a, b in pairs)
    return Found(measured, all(a > b for a, b in pairs))


def _finer_than_voxels(subject: Subject) -> Found:
    found = subject.learned()
    return Found(
        f"RMSE {found.error:.4f}; voxels of {found.megabytes[-1]:.2f} MB or more: dense "
        f"{found.dense_error:.4f}, only those with samples {found.sparse_error:.4f}",
        found.error < found.dense_error,
    )


def _learns_fast(subject: Subject) -> Found:
    ms = subject.learned().ms
    return Found(f"{ms:.0f} ms for {OilSettings().samples} samples", ms < 100.0)


def _flattens(subject: Subject) -> Found:
    memory = subject.learned().megabytes
    middle = memory[len(memory) // 2]
    return Found(
        f"{memory[0]:.2f} MB after the first frame, {middle:.2f} after half of them, "
        f"{memory[-1]:.2f} after all {len(memory)}",
        memory[-1] - middle < 0.5 * (middle - memory[0]),
    )


def _dearer(subject: Subject) -> Found:
    ratio = subject.ratio({"method": "vct"}, {"method": "em"}).value
    return Found(f"{ratio:.2f}x the time of em", ratio > 1.0)


def _with_place(subject: Subject) -> Found:
    cones, distant = (subject.scores({"method": name}).rmse for name in ("vct", "em"))
    return Found(f"RMSE {cones:.4g} against {distant:.4g}", cones < distant)


RTX_3080 = "RTX 3080, 1280x720"
GTX_2080 = "GeForce 2080, 1024x1024"
TITAN = "TITAN RTX"
CLAIMS = (
    Claim(
        IPRT,
        "SSIM above that of image-based lighting in all cuts",
        "in all cuts of Table 2",
        _above_ibl,
        "rasterized layers and one bounce miss what this view shows",
    ),
    Claim(
        IPRT,
        "Sparse tracing saves time and hardly changes the picture",
        f"11% to 25% less, SSIM above 0.96 (Table 3; {GTX_2080})",
        _sparse,
        "tracing takes a smaller share of the frame where specular objects, whose pixels are all "
        "traced, fill more of it",
    ),
    Claim(
        IPRT,
        "Substituted back faces (BASSRT) come nearer to the truth",
        "shown by pictures (Figure 8)",
        _back_faces,
        "few rays of these objects get behind surfaces",
    ),
    Claim(
        DPT,
        "1.5 times as fast as one-pass differential path tracing, or more, at equal samples",
        f"2.66x at 1 bounce, 2.05x at 3 (Table 1; {RTX_3080})",
        partial(_faster, surfaces="plane", bounces=(1, 3), least=1.5),
        "a look-up of a distant environment costs little beside a ray towards objects, which both "
        "send",
    ),
    Claim(
        DPT,
        "The same where the environment is found by rays through the panorama",
        "not measured",
        partial(_faster, surfaces="all", bounces=(1, 3), least=1.5),
        "",
    ),
    Claim(
        DPT,
        "No more error than one-pass differential path tracing",
        "by pictures (Figure 5)",
        _as_exact,
        "",
    ),
    Claim(
        DPT,
        "Time grows linearly with bounces beyond 3",
        f"34.0 ms at 3, 38.5 at 5, 41.6 at 7, 45.2 at 10 (Table 1; {RTX_3080})",
        _linear,
        "few paths live so long: further bounces cost next to nothing",
    ),
    Claim(
        DPT,
        "Multiple importance sampling costs at most 5% more than sampling by reflectance",
        f"+3% (Figure 3; {RTX_3080})",
        _sampling,
        "aimed rays cost a march of their own, and find their density at what they meet",
    ),
    Claim(
        NEI,
        "Environment mapping costs less than distance impostor tracing, by little once visibility "
        "is tested",
        "1.30x, 1.26x, 1.23x at 16, 32, 64 samples (Table 3; PC)",
        _impostor_costs,
        "each step of a ray looks up another place in memory, and rays of small objects are few",
    ),
    Claim(
        NEI,
        "The cache of directions lowers the cost per sample",
        "cache of 8: 0.128 ms from 8 to 16 samples, 0.013 from 64 to 128 (Table 4; PC)",
        _cache_costs,
        "where most directions miss the objects, the hierarchy is as quick to say so as boxes are",
    ),
    Claim(
        NEI,
        "Light varies over objects as in the reference more than with environment mapping",
        "by pictures (Figures 9 and 11)",
        _above_em,
        "",
    ),
    Claim(
        NEI,
        "Voxel cone tracing takes longer than environment mapping",
        "1.9x (Table 3), 1.2x to 1.5x (Table 4, cache 16 and 32)",
        _dearer,
        "em traces 8 and 16 rays per pixel and frame through triangles, vct 2 and 4 cones",
    ),
    Claim(
        NEI,
        "Voxel cone tracing varies with the place in the room, and comes nearer to the truth",
        "by pictures (Figures 9 and 11)",
        _with_place,
        "",
    ),
    Claim(
        OIL,
        "Shows more detail than a voxel volume of at least equal memory",
        "by pictures (Figure 10)",
        _finer_than_voxels,
        "the panorama has less detail than voxels of that size",
    ),
    Claim(
        OIL,
        "Learns in less than 100 ms per frame",
        f"17 to 92 ms (section VII-C; {TITAN})",
        _learns_fast,
        "the device is slower",
    ),
    Claim(
        OIL,
        "Memory grows ever more slowly",
        "364 to 416 MB after a thousand frames (Figure 11)",
        _flattens,
        "a panorama shows all surfaces from its first frame on",
    ),
)


def run_claims(
    scene: Scene,
    targets: Sequence[Target],
    *,
    device: ComputeDevice,
    frames: int,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Verdict]:
    """Measure every claim on every view.

    Parameters
    ----------
    frames : int
        See `Subject`.
    progress : callable, optional
        Called with the number of claims measured so far.
    """
    done = 0
    for target, frame in with_frames(scene, targets):
        subject = Subject(scene, target, frame, device, frames)
        for claim in CLAIMS:
            yield Verdict(claim, target.name, claim.measure(subject))
            done += 1
            if progress is not None:
                progress(done)


def claims_grid(verdicts: Sequence[Verdict]) -> Grid:
    """A row per claim and view."""
    rows = [verdict.record() for verdict in verdicts]
    keys = ("paper", "claim", "published", "view", "measured")
    return Grid(
        title="Claims of papers",
        columns=("paper", "claim", "published", "view", "here", "holds", "why not"),
        rows=tuple(
            (*(str(row[key]) for key in keys), "yes" if row["holds"] else "no", str(row["why"]))
            for row in rows
        ),
        words=7,
    )
