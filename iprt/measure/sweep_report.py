"""Tables, plots and pictures of a sweep's outcomes."""

from __future__ import annotations

from collections.abc import Sequence

from iprt.measure.intervals import CONFIDENCE
from iprt.measure.plot import Mark, Plot, Series
from iprt.measure.report import Figures, scored_pictures
from iprt.measure.sweep import Outcome, on_front, value_text
from iprt.measure.view_truth import Radiance
from iprt.output.grid import Grid

FRONT = "*"


def sweep_grid(outcomes: Sequence[Outcome]) -> Grid:
    """Build a table with a row per outcome. `outcomes` must not be empty."""
    first = outcomes[0]
    swept = list(dict.fromkeys(key for outcome in outcomes for key in outcome.combination.values))
    # If one setting changes at a time, a column per setting would be mostly empty.
    labelled = any(outcome.combination.values.keys() != set(swept) for outcome in outcomes)
    names = ["settings"] if labelled else swept
    several = len({outcome.target.name for outcome in outcomes}) > 1
    lead = ["#", *(["view"] if several else []), *names]
    cuts = max(len(outcome.ssim_cuts) for outcome in outcomes)
    flip = all(outcome.flip is not None for outcome in outcomes)
    columns = (
        *lead,
        "ms/frame",
        "ratio",
        *(f"SSIM cut {i + 1}" for i in range(cuts)),
        "SSIM",
        "RMSE",
        *(["FLIP"] if flip else []),
        "front",
    )
    rows = []
    marks = on_front(outcomes)
    for number, (outcome, mark) in enumerate(zip(outcomes, marks, strict=True), start=1):
        values = outcome.combination.values
        words = [outcome.combination.label] if labelled else [value_text(values[k]) for k in swept]
        shown = [cut.text() for cut in outcome.ssim_cuts] + ["-"] * (cuts - len(outcome.ssim_cuts))
        rows.append(
            (
                str(number),
                *([outcome.target.name] if several else []),
                *words,
                f"{outcome.ms:.1f}",
                "1" if outcome.ratio is None else outcome.ratio.text(),
                *shown,
                outcome.ssim.text(),
                outcome.rmse.text(),
                *([outcome.flip.text()] if flip and outcome.flip is not None else []),
                FRONT if mark else "",
            )
        )
    intervals = first.ssim.half is not None
    return Grid(
        title=", ".join(dict.fromkeys(outcome.target.name for outcome in outcomes)),
        columns=columns,
        rows=tuple(rows),
        notes=(
            "ratio: time relative to the view's first row, timed frame by frame beside it, with "
            f"its {CONFIDENCE:.0%} confidence interval.",
            f"{FRONT}: on the Pareto front of time and SSIM of the cuts.",
            *([f"±: {CONFIDENCE:.0%} confidence over seeds."] if intervals else []),
        ),
        words=len(lead),
    )


def passes_grid(outcomes: Sequence[Outcome]) -> Grid:
    """Build a table of the milliseconds of each pass, with a column per outcome number."""
    names = dict.fromkeys(row.name for outcome in outcomes for row in outcome.bench.passes)
    tables = [{row.name: row.ms for row in outcome.bench.passes} for outcome in outcomes]
    return Grid(
        title="Milliseconds per frame and pass",
        columns=("pass", *(str(number) for number in range(1, len(outcomes) + 1))),
        rows=tuple(
            (name, *(f"{table[name]:.2f}" if name in table else "" for table in tables))
            for name in names
        ),
    )


def sweep_plots(outcomes: Sequence[Outcome]) -> list[Plot]:
    """Plot the SSIM of the cuts over time, one plot per view."""
    marks = on_front(outcomes)
    numbered = list(zip(range(1, len(outcomes) + 1), outcomes, marks, strict=True))
    plots = []
    for view in dict.fromkeys(outcome.target.name for outcome in outcomes):
        mine = [entry for entry in numbered if entry[1].target.name == view]
        points = tuple(
            Mark(
                x=outcome.ms,
                y=1.0 - outcome.error,
                half=_half(outcome),
                hint=f"{number}: {outcome.combination.label}: {outcome.ms:.1f} ms",
                label=str(number),
                solid=mark,
            )
            for number, outcome, mark in mine
        )
        plots.append(
            Plot(
                title=f"{view}: time against accuracy",
                x_label="ms/frame",
                y_label="SSIM, mean of the cuts",
                series=(Series("", points, steps=True),),
                notes=("Numbers are the table's; the line is the Pareto front.",),
            )
        )
    return plots


def sweep_figures(number: int, outcome: Outcome, color: Radiance) -> Figures:
    """Show the pictures of one outcome, cropped to its cuts; `color` is linear."""
    cuts = " / ".join(cut.text() for cut in outcome.ssim_cuts)
    return Figures(
        title=f"{number}: {outcome.target.name}, {outcome.combination.label}",
        caption=f"{outcome.ms:.1f} ms/frame, SSIM of the cuts {cuts or '-'}",
        pictures=scored_pictures(outcome.target, color, crop=True),
    )


def _half(outcome: Outcome) -> float:
    """Return an upper bound of the half width for the cuts' mean, assuming full correlation."""
    halves = [cut.half or 0.0 for cut in outcome.ssim_cuts] or [outcome.ssim.half or 0.0]
    return sum(halves) / len(halves)
