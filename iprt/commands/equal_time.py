"""`iprt equal-time`: accuracy of settings and methods in equal times."""

from __future__ import annotations

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
    from iprt.commands.measurement import printed_at_last
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
    plan = measurement_flags.measurement(
        measurement_flags.open(scene), setting_flags, method=method, sweep=sweep_flags
    )
    output = plan.output
    plan.announce(f"{seconds} s per picture, then {counted(accumulate, 'frame')}")
    report = Report(f"{plan.scene.name}: accuracy at equal time", plan.lines())
    results: list[EqualTime] = []

    def finish() -> None:
        record = {**plan.record(), "results": [result.record() for result in results]}
        output.print(record, [costs_grid(results), equal_time_grid(results)])

    total = len(plan.targets) * len(plan.chosen)
    with printed_at_last(results, finish), progress_bar("rendering", total) as progress:
        for result, colors in run_equal_time(
            plan.scene,
            plan.targets,
            plan.chosen,
            budgets,
            device=plan.device,
            frames=accumulate,
            progress=progress,
        ):
            results.append(result)
            if output.html is not None:
                report.grids = [costs_grid(results), equal_time_grid(results)]
                report.figures.append(equal_time_figures(result, colors))
                output.write(report)
    return 0
