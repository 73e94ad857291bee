"""Table and pictures of the time to accuracy of several renderers."""

from __future__ import annotations

from collections.abc import Sequence

from iprt.measure.convergence_curves import seconds_to
from iprt.measure.report import Figures, scored_pictures
from iprt.measure.results import grid_of
from iprt.measure.time_to_accuracy import RaceResult
from iprt.measure.timed_renderers import FULL
from iprt.measure.view_truth import Radiance, Target
from iprt.output.grid import Grid


def race_grid(race: Sequence[Sequence[RaceResult]], levels: Sequence[float], *how: str) -> Grid:
    """Build a table of the seconds per picture to reach each SSIM level in each cut.

    Parameters
    ----------
    race : sequence of sequence of RaceResult
        Results of each view, at least one; iprt first.
    levels : sequence of float
    how : str
        Additional notes on the conditions of the measurement.
    """
    labels = [result.curve.label for result in race[0]]
    rows = []
    for results in race:
        view, cuts = results[0].curve.view, results[0].curve.cuts
        once = {result.curve.label: f"{result.once:.1f}" for result in results}
        rows.append({"view": view, "cut": "once", "SSIM": "", **once})
        rows += [
            {"view": view, "cut": name, "SSIM": f"{level:g}", **_cells(results, cut, level)}
            for cut, name in enumerate(cuts)
            for level in levels
        ]
    missing = [] if FULL in labels else [f"{FULL}: left out; --model names its module."]
    return grid_of(
        "Seconds to reach an SSIM",
        rows,
        "Seconds per picture until the cut has the SSIM; between pictures, SSIM is linear in the "
        f"logarithm of time. (x): times {labels[0]}'s.",
        "once: seconds per process, from its start to its first picture, minus the seconds of a "
        "second picture.",
        *how,
        *missing,
        words=2,
    )


def _cells(results: Sequence[RaceResult], cut: int, level: float) -> dict[str, str]:
    cells = {}
    ours = seconds_to(results[0].curve, cut, level)
    for result in results:
        seconds = seconds_to(result.curve, cut, level)
        if seconds is None:
            text = f"not reached (best {result.curve.best(cut):.4f})"
        else:
            text = f"{seconds:.2f}"
            if ours is not None and result is not results[0]:
                text += f" ({seconds / ours:.1f}x)"
        cells[result.curve.label] = text
    return cells


def race_figures(
    results: Sequence[RaceResult], target: Target, colors: Sequence[Radiance]
) -> list[Figures]:
    """Show the last picture of each renderer with the truth."""
    figures = []
    for result, color in zip(results, colors, strict=True):
        last = result.curve.points[-1]
        cuts = " / ".join(f"{cut.mean:.4f}" for cut in last.scores.cuts)
        figures.append(
            Figures(
                title=f"{target.name}, {result.curve.label}",
                caption=f"after {last.count}: SSIM {last.scores.ssim.mean:.4f}, cuts {cuts}",
                pictures=scored_pictures(target, color, crop=True),
            )
        )
    return figures
