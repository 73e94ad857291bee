"""`iprt equal-time`: accuracy of settings and methods in equal times."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import tyro

from iprt.commands.measurement_flags import EVERY_VIEW, NO_SWEEP, Measured, Swept, check_count
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.files.message_text import counted


def equal_time(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    seconds: str = "0.2,1,5",
    accumulate: int = 256,
    method: str | None = None,
    sweep_flags: Swept = NO_SWEEP,
    measurement_flags: Measured = EVERY_VIEW,
    setting_flags: ChosenSettings = BALANCED,
) -> int:
    """Score still pictures of settings or methods that were given equal times.

    The cost of a frame is shown too: in a still scene, with a new video frame, and with moved
    objects.

    Parameters
    ----------
    scene
        Scene folder.
    seconds
        Times per picture. The last picture that is finished in time is scored.
    accumulate
        Frames accumulated into one further picture, whatever time it takes.
    method
        Relighting method: a name from `iprt methods`. Short for --set method=.

    Returns
    -------
    int
        Exit status 0.
    """
    check_count("--accumulate", accumulate)
    from iprt.commands.progress import progress_bar
    from iprt.measure.equal_time import (
        EqualTime,
        costs_grid,
        equal_time_figures,
        equal_time_grid,
        parse_seconds,
        run_equal_time,
    )
    from iprt.measure.report import Report

    budgets = parse_seconds(seconds)
    plan = measurement_flags.plan(scene, setting_flags, method=method, sweep=sweep_flags)
    plan.announce(f"{seconds} s per picture, then {counted(accumulate, 'frame')}")

    def page(results: list[EqualTime]) -> Report:
        title = f"{plan.scene.name}: accuracy at equal time"
        return Report(title, plan.lines(), [costs_grid(results), equal_time_grid(results)])

    with progress_bar("rendering", plan.runs) as progress:
        found = run_equal_time(plan, budgets, accumulate, progress)
        measurement_flags.output.collect(
            (
                (one, partial(equal_time_figures, one, target, colors))
                for one, target, colors in found
            ),
            "results",
            plan.record(),
            page,
        )
    return 0
