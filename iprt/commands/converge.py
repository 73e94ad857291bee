"""`iprt converge`: accuracy of a still picture over the time spent on it."""

from __future__ import annotations

from pathlib import Path

import tyro

from iprt.commands.measurement_flags import EVERY_VIEW, NO_SWEEP, Measured, Swept
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.files.message_text import counted


def converge(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    accumulate: str = "1,2,...,64",
    reach: str = "0.9,0.93,0.95",
    seeds: int = 3,
    method: str | None = None,
    sweep_flags: Swept = NO_SWEEP,
    measurement_flags: Measured = EVERY_VIEW,
    setting_flags: ChosenSettings = BALANCED,
) -> int:
    """Score a still picture against the truth while it converges, and show the seconds spent.

    Parameters
    ----------
    scene
        Scene folder.
    accumulate
        Numbers of accumulated frames at which the picture is scored, such as 1,2,4,8 or
        1,2,...,256.
    reach
        Values of SSIM in the view's cuts; a table shows the seconds until each is reached.
    seeds
        Pictures per combination, each with another random seed, for means and 95% confidence
        intervals.
    method
        Relighting method: a name from `iprt methods`. Short for --set method=.

    Returns
    -------
    int
        Exit status 0.
    """
    from iprt.commands.measurement import parse_levels
    from iprt.commands.progress import progress_bar
    from iprt.measure.convergence_curves import Curve, parse_counts, run_convergence
    from iprt.measure.convergence_report import convergence_grid, convergence_plots, reach_grid
    from iprt.measure.report import Report

    counts, levels = parse_counts(accumulate), parse_levels(reach)
    plan = measurement_flags.plan(
        scene, setting_flags, method=method, sweep=sweep_flags, seeds=seeds
    )
    plan.announce(f"{counted(counts[-1], 'frame')} each")

    def page(curves: list[Curve]) -> Report:
        title = f"{plan.scene.name}: accuracy against time"
        grids = [convergence_grid(curves), reach_grid(curves, levels)]
        return Report(title, plan.lines(), grids, convergence_plots(curves))

    with progress_bar("rendering", plan.runs * counts[-1]) as progress:
        curves = run_convergence(plan, counts, progress)
        measurement_flags.output.collect(
            ((curve, tuple) for curve in curves), "curves", plan.record(), page
        )
    return 0
