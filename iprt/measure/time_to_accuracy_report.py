"""Table and pictures of the time to accuracy of several renderers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from iprt.measure.convergence import seconds_to
from iprt.measure.convergence_report import cut_name, cuts_of
from iprt.measure.report import Figures, scored_pictures
from iprt.measure.time_to_accuracy import Result
from iprt.measure.timed_renderers import FULL
from iprt.measure.view_truth import Target
from iprt.output.grid import Grid

Race = Mapping[str, Sequence[Result]]
"""Results by view, iprt first."""


def race_grid(race: Race, levels: Sequence[float], how: Sequence[str]) -> Grid:
    """Build a table of the seconds per picture to reach each SSIM level in each cut.

    Parameters
    ----------
    race : mapping of str to sequence of Result
        At least one view.
    levels : sequence of float
    how : sequence of str
        Additional notes on the conditions of the measurement.
    """
    labels = [result.curve.label for result in next(iter(race.values()))]
    rows = []
    for view, results in race.items():
        rows.append((view, "once", "", *(f"{result.once:.1f}" for result in results)))
        rows += [
            (view, cut_name(cut), f"{level:g}", *_cells(results, cut, level))
            for cut in cuts_of(results[0].curve)
            for level in levels
        ]
    notes = [
        "Seconds per picture until the cut has the SSIM; between pictures, SSIM is linear in the "
        f"logarithm of time. (x): times {labels[0]}'s.",
        "once: seconds per process, from its start to its first picture, minus the seconds of a "
        "second picture.",
        *how,
    ]
    if FULL not in labels:
        notes.append(f"{FULL}: left out; --model names the module that builds it.")
    return Grid(
        title="Seconds to reach an SSIM",
        columns=("view", "cut", "SSIM", *labels),
        rows=tuple(rows),
        notes=tuple(notes),
        words=2,
    )


def _cells(results: Sequence[Result], cut: int | None, level: float) -> list[str]:
    ours = seconds_to(results[0].curve.points, cut, level)
    cells = []
    for index, result in enumerate(results):
        seconds = seconds_to(result.curve.points, cut, level)
        if seconds is None:
            best = max(point.reached(cut) for point in result.curve.points)
            cells.append(f"not reached (best {best:.4f})")
        elif index == 0 or ours is None:
            cells.append(f"{seconds:.2f}")
        else:
            cells.append(f"{seconds:.2f} ({seconds / ours:.1f}x)")
    return cells


def race_figures(target: Target, results: Sequence[Result]) -> list[Figures]:
    """Show the last picture of each renderer with the truth."""
    figures = []
    for result in results:
        last = result.curve.points[-1]
        cuts = " / ".join(f"{cut.mean:.4f}" for cut in last.ssim_cuts)
        figures.append(
            Figures(
                title=f"{target.name}, {result.curve.label}",
                caption=f"after {last.count}: SSIM {last.ssim.mean:.4f}"
                + (f", cuts {cuts}" if cuts else ""),
                pictures=scored_pictures(target, result.color, crop=True),
            )
        )
    return figures
