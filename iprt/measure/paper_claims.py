"""Claims of the papers behind the methods, with the measurement of each claim."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from statistics import fmean, median
from typing import Any

import numpy as np

from iprt.measure.claims import Claim, ClaimView, Finding
from iprt.settings.trace import LearningSettings

IPRT = "IPRT (Wu and Wang 2023)"
DPT = "DPT (Xu et al. 2023)"
NEI = "NEI (Rohmer et al. 2017)"
OIL = "OIL (Lee et al. 2022)"
DVCT = "DVCT (Franke 2014)"


def _faster(view: ClaimView, *, surfaces: str, bounces: Sequence[int], least: float) -> Finding:
    ratios = []
    for count in bounces:
        delta, one_pass = (_paths(method, surfaces, count) for method in ("dpt", "pt-diff"))
        ratios.append(view.ratio(one_pass, delta))
    measured = ", ".join(f"{r.value:.2f}x at {n}" for n, r in zip(bounces, ratios, strict=True))
    return Finding(f"{measured} (surfaces={surfaces})", min(r.value for r in ratios) >= least)


def _paths(method: str, surfaces: str, bounces: int) -> dict[str, Any]:
    return {"method": method, f"{method}.surfaces": surfaces, f"{method}.bounces": bounces}


def _as_exact(view: ClaimView) -> Finding:
    delta, one_pass = (
        view.scores({"method": name, f"{name}.surfaces": "all"}).rmse for name in ("dpt", "pt-diff")
    )
    holds = abs(delta / one_pass - 1.0) < 0.05
    return Finding(f"RMSE {delta:.4g} and {one_pass:.4g} (surfaces=all)", holds)


def _line(counts: Sequence[int], times: Sequence[float]) -> tuple[float, float]:
    """Fit a line; return its slope and the largest distance of a time from it."""
    line = np.polyfit(counts, times, 1)
    return float(line[0]), float(np.abs(np.polyval(line, counts) - times).max())


def _linear(view: ClaimView) -> Finding:
    counts = (3, 5, 7, 10)
    times = [median(t) for t in view.times(*(_paths("dpt", "all", n) for n in counts))]
    off = _line(counts, times)[1] / times[0]
    measured = ", ".join(f"{t:.1f} ms at {n}" for n, t in zip(counts, times, strict=True))
    return Finding(f"{measured}: {100 * off:.0f}% off a line (surfaces=all)", off < 0.05)


def _sampling(view: ClaimView) -> Finding:
    mixed = _paths("dpt", "all", 3)
    ratio = view.ratio(mixed, {**mixed, "trace.light_sampling": False})
    return Finding(f"{100 * (ratio.value - 1):+.0f}% (surfaces=all)", ratio.value < 1.05)


def _cuts(
    view: ClaimView, ours: dict[str, Any], theirs: dict[str, Any], digits: int = 3
) -> tuple[list[tuple[float, float]], str]:
    """Return the SSIM of each cut with two variants, and as text."""
    pairs = list(zip(view.scores(ours).cuts, view.scores(theirs).cuts, strict=True))
    return pairs, ", ".join(f"{a:.{digits}f} against {b:.{digits}f}" for a, b in pairs)


def _above(view: ClaimView, *, ours: str, theirs: str) -> Finding:
    pairs, measured = _cuts(view, {"method": ours}, {"method": theirs})
    return Finding(measured, all(a > b for a, b in pairs))


def _sparse(view: ClaimView) -> Finding:
    dense = {"method": "iprt2023", "mask.sparse": False}
    sparse = {"method": "iprt2023", "mask.sparse": True}
    saved = 1.0 - view.ratio(sparse, dense).value
    alike = view.likeness(sparse, dense)
    return Finding(f"{100 * saved:.0f}% less time, SSIM {alike:.3f}", saved > 0.0 and alike > 0.96)


def _back_faces(view: ClaimView) -> Finding:
    found, without = ({"method": "iprt2023", "trace.back_faces": on} for on in (True, False))
    pairs, measured = _cuts(view, found, without, digits=4)
    return Finding(measured, math.fsum(a - b for a, b in pairs) > 0.0)


def _impostor_costs(view: ClaimView) -> Finding:
    rays = {"trace.rays": 16, "trace.object_rays": 16}
    impostor = {"method": "dit", "dit.directions": "boxes", **rays}
    ratio = view.ratio(impostor, {"method": "em", **rays})
    return Finding(f"{ratio.value:.2f}x at 16 samples, of whole frames", 1.0 < ratio.value < 1.5)


def _cache_costs(view: ClaimView) -> Finding:
    """Compare the marginal cost of a direction, which excludes the fixed costs of a frame."""
    few, many = 32, 128
    cost = {}
    for way in ("cached", "all"):
        of = {"method": "dit", "dit.directions": way}
        times = view.times(*({**of, "trace.rays": n} for n in (few, many)))
        first, last = (median(t) for t in times)
        cost[way] = (last - first) / (many - few)
    measured = f"{cost['cached']:.3f} ms a direction with the cache, {cost['all']:.3f} without"
    return Finding(measured, cost["cached"] < 0.9 * cost["all"])


def _finer_than_voxels(view: ClaimView) -> Finding:
    found = view.learned
    return Finding(
        f"RMSE {found.error:.4f}; voxels of {found.megabytes[-1]:.2f} MB or more: dense "
        f"{found.dense_error:.4f}, only those with samples {found.sparse_error:.4f}",
        found.error < found.dense_error,
    )


def _learns_fast(view: ClaimView) -> Finding:
    ms = view.learned.ms
    return Finding(f"{ms:.0f} ms for {LearningSettings().samples} samples", ms < 100.0)


def _flattens(view: ClaimView) -> Finding:
    memory = view.learned.megabytes
    middle = memory[len(memory) // 2]
    return Finding(
        f"{memory[0]:.2f} MB after the first frame, {middle:.2f} after half of them, "
        f"{memory[-1]:.2f} after all {len(memory)}",
        memory[-1] - middle < 0.5 * (middle - memory[0]),
    )


def _dearer(view: ClaimView) -> Finding:
    ratio = view.ratio({"method": "vct"}, {"method": "em"}).value
    return Finding(f"{ratio:.2f}x the time of em", ratio > 1.0)


def _with_place(view: ClaimView) -> Finding:
    cones, distant = (view.scores({"method": name}).rmse for name in ("vct", "em"))
    return Finding(f"RMSE {cones:.4g} against {distant:.4g}", cones < distant)


def _grows(view: ClaimView) -> Finding:
    """Fit a line to the time over the number of cones, equal for real surfaces and objects."""
    counts = (2, 4, 8, 16)
    variants = [
        {"method": "dvct", "trace.rays": n, "trace.object_rays": n, "dvct.cones": 16}
        for n in counts
    ]
    times = [median(t) for t in view.times(*variants)]
    slope, off = _line(counts, times)
    measured = ", ".join(f"{t:.1f} ms with {n}" for n, t in zip(counts, times, strict=True))
    off /= times[-1]
    return Finding(f"{measured}: {100 * off:.0f}% off a line", off < 0.05 and slope > 0.0)


def _near_contact(view: ClaimView) -> Finding:
    near, far = view.errors({"method": "dvct"})
    return Finding(f"{near:.4f} near objects, {far:.4f} elsewhere", near > far)


def _finer(view: ClaimView) -> Finding:
    counts = (32, 64, 128)
    means = [fmean(view.scores({"method": "dvct", "dvct.voxels": n}).cuts) for n in counts]
    measured = ", ".join(f"{m:.4f} with {n}³" for n, m in zip(counts, means, strict=True))
    return Finding(measured, means[0] < means[1] < means[2])


def _quicker_than_paths(view: ClaimView) -> Finding:
    ratio = view.ratio(_paths("pt-diff", "all", 1), {"method": "dvct"}).value
    return Finding(f"{ratio:.2f}x (pt-diff, surfaces=all, 1 bounce)", ratio > 1.0)


RTX_3080 = "RTX 3080, 1280x720"
GTX_2080 = "GeForce 2080, 1024x1024"
TITAN = "TITAN RTX"
GTX_780 = "GTX 780"
CLAIMS = (
    Claim(
        IPRT,
        "SSIM above image-based lighting's in all cuts",
        "in all cuts of Table 2",
        partial(_above, ours="iprt2023", theirs="ibl"),
        "rasterized layers and one bounce do not suffice for this view",
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
        "aimed rays cost a march of their own, and find their density at the surface that they hit",
    ),
    Claim(
        NEI,
        "Environment mapping costs less than distance impostor tracing, by little once visibility "
        "is tested",
        "1.30x, 1.26x, 1.23x at 16, 32, 64 samples (Table 3; PC)",
        _impostor_costs,
        "look-ups cost little beside rays towards objects, which both send: the ratio is near 1",
    ),
    Claim(
        NEI,
        "The cache of directions lowers the cost per sample",
        "cache of 8: 0.128 ms from 8 to 16 samples, 0.013 from 64 to 128 (Table 4; PC)",
        _cache_costs,
        "where most directions miss the objects, the hierarchy finds that as quickly as boxes do",
    ),
    Claim(
        NEI,
        "Light varies over objects as in the reference more than with environment mapping",
        "by pictures (Figures 9 and 11)",
        partial(_above, ours="dit", theirs="em"),
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
        DVCT,
        "Time grows linearly with the number of cones",
        f"cones of all surfaces are traced in the same way (section 3.2; {GTX_780})",
        _grows,
        "other passes take most of a frame's time",
    ),
    Claim(
        DVCT,
        "Errors are largest near the contact of objects and real surfaces",
        "by pictures (Figure 3)",
        _near_contact,
        "regions that stand for all light make errors of their own far from objects",
    ),
    Claim(
        DVCT,
        "Finer volumes come nearer to the truth",
        "256³ and more (sections 3.2 and 4.4)",
        _finer,
        "once voxels are small, lights and wide cones decide",
    ),
    Claim(
        DVCT,
        "Takes less time than ray tracing",
        f"29 ms against 714 and 588 (Figure 5; {GTX_780}, GTX 690, 720x576)",
        _quicker_than_paths,
        "rays that meet no object end at once, cones go through all voxels on their way",
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
