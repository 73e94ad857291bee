"""`iprt race`: the seconds that iprt and Mitsuba need to reach the same accuracy."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

import tyro

from iprt.commands.measurement_flags import EVERY_VIEW, NO_SWEEP, Measured, Swept
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.files.message_text import counted


def race(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    accumulate: str = "1,2,...,64",
    reach: str = "0.9,0.93,0.95",
    model: str | None = None,
    seeds: int = 3,
    method: str | None = None,
    sweep_flags: Swept = NO_SWEEP,
    measurement_flags: Measured = EVERY_VIEW,
    setting_flags: ChosenSettings = BALANCED,
) -> int:
    """Compare the time to reach an accuracy with Mitsuba's, on the same processor.

    Mitsuba, with Open Image Denoise, renders the world that the panorama describes and, with
    --model, the full geometry. Each renderer has its own process, and they take turns. The seconds
    are a picture's; start-up is shown apart. Needs the extra `reference`: pip install
    'iprt[reference]'.

    Parameters
    ----------
    scene
        Scene folder.
    accumulate
        Numbers of accumulated frames at which the picture is scored, such as 1,2,4,8 or
        1,2,...,256; of Mitsuba, samples per pixel.
    reach
        Values of SSIM in the view's cuts; a table shows the seconds until each is reached.
    model
        Python module with the scene's full geometry, as for `iprt reference`.
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
    from iprt.measure.convergence_curves import parse_counts
    from iprt.measure.convergence_report import convergence_grid, convergence_plots
    from iprt.measure.protocol import provenance_line
    from iprt.measure.report import Report
    from iprt.measure.time_to_accuracy import RaceResult, run_race
    from iprt.measure.time_to_accuracy_report import race_figures, race_grid
    from iprt.measure.timed_renderers import RacedView, raced_iprt, raced_mitsuba
    from iprt.truth.backend import require_reference
    from iprt.truth.model import load_parts

    require_reference()
    counts, levels = parse_counts(accumulate), parse_levels(reach)
    plan = measurement_flags.plan(
        scene, setting_flags, method=method, sweep=sweep_flags, seeds=seeds
    )
    renderers = [raced_iprt(one, measurement_flags.device) for one in plan.chosen]
    if model is not None:
        load_parts(model)  # report faults before anything is measured
        renderers.append(raced_mitsuba(model))
    renderers.append(raced_mitsuba(None))
    outside = measurement_flags.allow_outside
    views = [RacedView(plan.scene.root, outside, target) for target in plan.targets]
    plan.announce(f"up to {counted(counts[-1], 'frame')} or samples per pixel each")
    how = (
        f"{plan.sizes}; iprt on {plan.device.name}, Mitsuba and Open Image Denoise on "
        f"{counted(os.cpu_count() or 1, 'core')}; {counted(plan.seeds, 'seed')}."
    )

    def page(race: list[list[RaceResult]]) -> Report:
        curves = [result.curve for results in race for result in results]
        grids = [race_grid(race, levels, how)]
        if not measurement_flags.markdown:
            grids.insert(0, convergence_grid(curves))
        lines = [how, provenance_line(plan.made)]
        title = f"{plan.scene.name}: against Mitsuba"
        return Report(title, lines, grids, convergence_plots(curves))

    total = len(views) * len(renderers) * len(counts) * plan.seeds
    with progress_bar("rendering", total, "pictures") as progress:
        found = run_race(
            views, renderers, counts, enough=max(levels), seeds=plan.seeds, progress=progress
        )
        measurement_flags.output.collect(
            ((each, partial(race_figures, each, view, colors)) for each, view, colors in found),
            "views",
            plan.record(),
            page,
        )
    return 0
