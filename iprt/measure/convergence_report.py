"""Tables and plots of convergence curves."""

from __future__ import annotations

from collections.abc import Sequence

from iprt.measure.convergence import Curve, seconds_to
from iprt.measure.intervals import CONFIDENCE
from iprt.measure.plot import Mark, Plot, Series
from iprt.output.grid import Grid


def convergence_grid(curves: Sequence[Curve]) -> Grid:
    """Build a table with a row per picture. `curves` must not be empty."""
    cuts = max(len(curve.points[0].ssim_cuts) for curve in curves)
    rows = [
        (
            curve.view,
            curve.label,
            str(point.count),
            point.seconds.text(2),
            *(cut.text() for cut in point.ssim_cuts),
            *["-"] * (cuts - len(point.ssim_cuts)),
            point.ssim.text(),
        )
        for curve in curves
        for point in curve.points
    ]
    intervals = curves[0].points[0].ssim.half is not None
    return Grid(
        title="Accuracy after so many frames (Mitsuba: samples per pixel)",
        columns=(
            "view",
            "settings",
            "count",
            "s",
            *(f"SSIM cut {index + 1}" for index in range(cuts)),
            "SSIM",
        ),
        rows=tuple(rows),
        notes=(f"±: {CONFIDENCE:.0%} confidence over seeds.",) if intervals else (),
        words=2,
    )


def reach_grid(curves: Sequence[Curve], levels: Sequence[float]) -> Grid:
    """Build a table of the seconds to reach each SSIM level, with a row per curve and cut."""
    rows = []
    for curve in curves:
        for cut in cuts_of(curve):
            times = [seconds_to(curve.points, cut, level) for level in levels]
            rows.append(
                (
                    curve.view,
                    cut_name(cut),
                    curve.label,
                    *("-" if seconds is None else f"{seconds:.2f}" for seconds in times),
                    f"{max(point.reached(cut) for point in curve.points):.4f}",
                )
            )
    return Grid(
        title="Seconds to reach an SSIM",
        columns=("view", "cut", "settings", *(f"{level:g}" for level in levels), "best SSIM"),
        rows=tuple(sorted(rows, key=lambda row: row[:2])),
        notes=("-: not reached. Between pictures, SSIM is linear in the logarithm of time.",),
        words=3,
    )


def convergence_plots(curves: Sequence[Curve]) -> list[Plot]:
    """Plot SSIM over seconds, one plot per view and cut."""
    plots = []
    for view in dict.fromkeys(curve.view for curve in curves):
        mine = [curve for curve in curves if curve.view == view]
        plots += [
            Plot(
                title=f"{view}, {cut_name(cut)}: accuracy against time",
                x_label="seconds",
                y_label="SSIM",
                series=tuple(_series(curve, cut) for curve in mine),
            )
            for cut in cuts_of(mine[0])
        ]
    return plots


def _series(curve: Curve, cut: int | None) -> Series:
    marks = []
    for point in curve.points:
        estimate = point.ssim if cut is None else point.ssim_cuts[cut]
        hint = f"{curve.label}: {point.count} in {point.seconds.mean:.2f} s: {estimate.text()}"
        marks.append(Mark(point.seconds.mean, estimate.mean, estimate.half or 0.0, hint))
    return Series(curve.label, tuple(marks))


def cuts_of(curve: Curve) -> list[int | None]:
    """Return the indices of the view's cuts, or [None], the whole view, if it has none."""
    return list(range(len(curve.points[0].ssim_cuts))) or [None]


def cut_name(cut: int | None) -> str:
    """Return a cut's name, such as `cut 1` for index 0."""
    return "whole view" if cut is None else f"cut {cut + 1}"
