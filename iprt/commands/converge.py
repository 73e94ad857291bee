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
    from iprt.commands.measurement import parse_levels, printed_at_last
    from iprt.commands.progress import progress_bar
    from iprt.measure.convergence import Curve, parse_counts, run_convergence
    from iprt.measure.convergence_report import convergence_grid, convergence_plots, reach_grid
    from iprt.measure.report import Report

    counts, levels = parse_counts(accumulate), parse_levels(reach)
    plan = measurement_flags.measurement(
        measurement_flags.open(scene), setting_flags, method=method, sweep=sweep_flags, seeds=seeds
    )
    plan.announce(f"{counted(counts[-1], 'frame')} each")
    report = Report(f"{plan.scene.name}: accuracy against time", plan.lines())
    curves: list[Curve] = []

    def finish() -> None:
        record = {**plan.record(), "curves": [curve.record() for curve in curves]}
        plan.output.print(record, [convergence_grid(curves), reach_grid(curves, levels)])

    runs = len(plan.targets) * plan.seeds
    total = len(plan.chosen) * runs * counts[-1]
    with printed_at_last(curves, finish), progress_bar("rendering", total) as progress:
        for curve in run_convergence(
            plan.scene,
            plan.targets,
            plan.chosen,
            counts,
            device=plan.device,
            seeds=plan.seeds,
            progress=progress,
        ):
            curves.append(curve)
            report.grids = [reach_grid(curves, levels), convergence_grid(curves)]
            report.plots = convergence_plots(curves)
            plan.output.write(report)
    return 0
