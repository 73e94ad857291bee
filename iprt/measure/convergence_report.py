"""Tables and plots of convergence curves."""

from __future__ import annotations

from collections.abc import Sequence

from iprt.measure.convergence_curves import Curve, seconds_to
from iprt.measure.intervals import OVER_SEEDS
from iprt.measure.plot import Mark, Plot, Series
from iprt.measure.results import grid_of
from iprt.output.grid import Grid


def convergence_grid(curves: Sequence[Curve]) -> Grid:
    """Build a table with a row per picture. `curves` must not be empty."""
    rows = [
        {
            "view": curve.view,
            "settings": curve.label,
            "count": str(point.count),
            "s": point.seconds.text(2),
            **point.scores.cells(),
        }
        for curve in curves
        for point in curve.points
    ]
    intervals = curves[0].points[0].scores.ssim.half is not None
    return grid_of(
        "Accuracy after a number of frames (Mitsuba: samples per pixel)",
        rows,
        *([OVER_SEEDS] if intervals else []),
        words=2,
    )


def reach_grid(curves: Sequence[Curve], levels: Sequence[float]) -> Grid:
    """Build a table of the seconds to reach each SSIM level, with a row per curve and cut."""
    rows = []
    for curve in curves:
        for cut, name in enumerate(curve.cuts):
            times = {f"{level:g}": seconds_to(curve, cut, level) for level in levels}
            rows.append(
                {
                    "view": curve.view,
                    "cut": name,
                    "settings": curve.label,
                    **{level: "-" if s is None else f"{s:.2f}" for level, s in times.items()},
                    "best SSIM": f"{curve.best(cut):.4f}",
                }
            )
    return grid_of(
        "Seconds to reach an SSIM",
        sorted(rows, key=lambda row: (row["view"], row["cut"])),
        "-: not reached. Between pictures, SSIM is linear in the logarithm of time.",
        words=3,
    )


def convergence_plots(curves: Sequence[Curve]) -> list[Plot]:
    """Plot SSIM over seconds, one plot per view and cut."""
    plots: dict[tuple[str, str], list[Series]] = {}
    for curve in curves:
        for cut, name in enumerate(curve.cuts):
            marks = []
            for point in curve.points:
                ssim, seconds = point.scores.cuts[cut], point.seconds.mean
                hint = f"{curve.label}: {point.count} in {seconds:.2f} s: {ssim.text()}"
                marks.append(Mark(seconds, ssim.mean, ssim.half or 0.0, hint))
            plots.setdefault((curve.view, name), []).append(Series(curve.label, tuple(marks)))
    return [
        Plot(f"{view}, {cut}: accuracy against time", "seconds", "SSIM", tuple(series))
        for (view, cut), series in plots.items()
    ]
