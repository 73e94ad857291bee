"""`iprt sweep`: the speed and accuracy of combinations of settings."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from iprt.commands.measurement_flags import (
    EVERY_VIEW,
    Measured,
    SweepFlags,
    check_count,
)
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.errors import IprtError
from iprt.files.message_text import counted

MANY = 10
"""Outcomes up to which a terminal has room for all their passes."""


def sweep(
    scene: tyro.conf.Positional[Path],
    values: Annotated[
        tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="KEY=VALUE,VALUE,...")
    ],
    /,
    *,
    one_at_a_time: bool = False,
    accumulate: int = 30,
    seeds: int = 3,
    method: str | None = None,
    measurement_flags: Measured = EVERY_VIEW,
    setting_flags: ChosenSettings = BALANCED,
) -> int:
    """Measure the speed and accuracy of combinations of settings.

    Frames are timed as by `iprt bench`, and still pictures are scored against the truth. The table
    marks the Pareto front: the combinations that no other one beats in both.

    Parameters
    ----------
    scene
        Scene folder.
    values
        Values of a setting to compare, such as trace.rays=1,2, quality=draft,balanced or
        method=all. Several settings: all combinations.
    one_at_a_time
        Change one setting at a time, instead of measuring all combinations.
    accumulate
        Frames accumulated into each picture. At least as many are timed.
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
    check_count("--accumulate", accumulate)
    if not values:
        raise IprtError("no setting to vary; add one, such as trace.rays=1,2")
    from iprt.commands.progress import progress_bar
    from iprt.measure.report import Report
    from iprt.measure.sweep import Outcome, frames_per_view, run_sweep
    from iprt.measure.sweep_report import passes_grid, sweep_figures, sweep_grid, sweep_plots

    swept = SweepFlags(values, one_at_a_time)
    plan = measurement_flags.plan(scene, setting_flags, method=method, sweep=swept, seeds=seeds)
    plan.announce(f"{counted(accumulate, 'frame')} each")

    def page(outcomes: list[Outcome]) -> Report:
        grids = [sweep_grid(outcomes)]
        if len(outcomes) <= MANY and not measurement_flags.markdown:
            grids.append(passes_grid(outcomes))
        title = f"{plan.scene.name}: speed and accuracy"
        return Report(title, plan.lines(), grids, sweep_plots(outcomes))

    total = len(plan.targets) * frames_per_view(len(plan.chosen), accumulate, plan.seeds)
    with progress_bar("sweeping", total) as progress:
        found = enumerate(run_sweep(plan, accumulate, progress), start=1)
        measurement_flags.output.collect(
            ((one, partial(sweep_figures, n, one, view, color)) for n, (one, view, color) in found),
            "rows",
            {**plan.record(), "frames": accumulate},
            page,
        )
    return 0
