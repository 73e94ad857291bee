"""Tables, plots and pictures of a sweep's outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean

from iprt.measure.combinations import value_text
from iprt.measure.intervals import CONFIDENCE, OVER_SEEDS
from iprt.measure.plot import Mark, Plot, Series
from iprt.measure.report import Figures, scored_pictures
from iprt.measure.results import grid_of
from iprt.measure.sweep import Outcome, on_front
from iprt.measure.view_truth import Radiance, Target
from iprt.output.grid import Grid

FRONT = "*"


def sweep_grid(outcomes: Sequence[Outcome]) -> Grid:
    """Build a table with a row per outcome. `outcomes` must not be empty."""
    swept = list(dict.fromkeys(key for outcome in outcomes for key in outcome.combination.values))
    # If one setting changes at a time, a column per setting would be mostly empty.
    labelled = any(outcome.combination.values.keys() != set(swept) for outcome in outcomes)
    views = list(dict.fromkeys(outcome.view for outcome in outcomes))
    rows = []
    for number, (outcome, mark) in enumerate(zip(outcomes, on_front(outcomes), strict=True), 1):
        values, scores = outcome.combination.values, outcome.scores
        named = {key: value_text(values[key]) for key in swept} if not labelled else {}
        lead = {
            "#": str(number),
            **({"view": outcome.view} if len(views) > 1 else {}),
            **(named or {"settings": outcome.combination.label}),
        }
        rows.append(
            {
                **lead,
                "ms/frame": f"{outcome.ms:.1f}",
                "ratio": "1" if outcome.ratio is None else outcome.ratio.text(),
                **scores.cells(),
                "RMSE": scores.rmse.text(),
                **({} if scores.flip is None else {"FLIP": scores.flip.text()}),
                "front": FRONT if mark else "",
            }
        )
    return grid_of(
        ", ".join(views),
        rows,
        "ratio: time relative to the view's first row, timed frame by frame beside it, with "
        f"its {CONFIDENCE:.0%} confidence interval.",
        f"{FRONT}: on the Pareto front of time and SSIM of the cuts.",
        *([OVER_SEEDS] if outcomes[0].scores.ssim.half is not None else []),
        words=len(lead),
    )


def passes_grid(outcomes: Sequence[Outcome]) -> Grid:
    """Build a table of the milliseconds of each pass, with a column per outcome number."""
    rows: dict[str, dict[str, str]] = {}
    for number, outcome in enumerate(outcomes, start=1):
        for row in outcome.bench.passes:
            rows.setdefault(row.name, {"pass": row.name})[str(number)] = f"{row.timing.ms:.2f}"
    return grid_of("Milliseconds per frame and pass", list(rows.values()))


def sweep_plots(outcomes: Sequence[Outcome]) -> list[Plot]:
    """Plot the SSIM of the cuts over time, one plot per view."""
    marks: dict[str, list[Mark]] = {}
    for number, (outcome, solid) in enumerate(zip(outcomes, on_front(outcomes), strict=True), 1):
        mark = Mark(
            x=outcome.ms,
            y=outcome.scores.accuracy,
            # An upper bound for the cuts' mean, assuming full correlation.
            half=fmean(cut.half or 0.0 for cut in outcome.scores.cuts),
            hint=f"{number}: {outcome.combination.label}: {outcome.ms:.1f} ms",
            label=str(number),
            solid=solid,
        )
        marks.setdefault(outcome.view, []).append(mark)
    return [
        Plot(
            title=f"{view}: time against accuracy",
            x_label="ms/frame",
            y_label="SSIM, mean of the cuts",
            series=(Series("", tuple(points), steps=True),),
            notes=("Numbers are the table's; the line is the Pareto front.",),
        )
        for view, points in marks.items()
    ]


def sweep_figures(
    number: int, outcome: Outcome, target: Target, color: Radiance
) -> tuple[Figures, ...]:
    """Show the pictures of one outcome, cropped to its cuts; `color` is linear."""
    cuts = " / ".join(cut.text() for cut in outcome.scores.ssim_cuts)
    figures = Figures(
        title=f"{number}: {outcome.view}, {outcome.combination.label}",
        caption=f"{outcome.ms:.1f} ms/frame, SSIM of the cuts {cuts or '-'}",
        pictures=scored_pictures(target, color, crop=True),
    )
    return (figures,)
