"""`iprt race`: the seconds that iprt and Mitsuba need to reach the same accuracy."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from iprt.commands.measurement_flags import EVERY_VIEW, NO_SWEEP, Measured, Swept
from iprt.commands.setting_flags import BALANCED, ChosenSettings
from iprt.files.message_text import counted

if TYPE_CHECKING:
    from iprt.commands.measurement import Measurement


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
    --model, the full geometry. Each renderer has its own process, and they take turns. Seconds are
    those of a picture; start-up is shown apart. Needs the extra `reference`: pip install
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
    from iprt.commands.measurement import parse_levels, printed_at_last
    from iprt.commands.progress import progress_bar
    from iprt.measure.convergence import parse_counts
    from iprt.measure.convergence_report import convergence_grid, convergence_plots
    from iprt.measure.protocol import provenance_line
    from iprt.measure.report import Report
    from iprt.measure.time_to_accuracy import Result, run_race
    from iprt.measure.time_to_accuracy_report import race_figures, race_grid
    from iprt.measure.timed_renderers import Entry, FullEntry, IprtEntry, PanoramaEntry, Subject
    from iprt.truth.backend import require_reference
    from iprt.truth.model import load_parts

    require_reference()
    counts, levels = parse_counts(accumulate), parse_levels(reach)
    plan = measurement_flags.measurement(
        measurement_flags.open(scene), setting_flags, method=method, sweep=sweep_flags, seeds=seeds
    )
    entries: list[Entry] = [IprtEntry(one, measurement_flags.device) for one in plan.chosen]
    if model is not None:
        load_parts(model)  # report faults before anything is measured
        entries.append(FullEntry(model))
    entries.append(PanoramaEntry())
    subjects = [
        Subject(plan.scene.root, measurement_flags.allow_outside, target) for target in plan.targets
    ]
    plan.announce(f"up to {counted(counts[-1], 'frame')} or samples per pixel each")
    how = [_conditions(plan)]
    report = Report(f"{plan.scene.name}: against Mitsuba", [*how, provenance_line(plan.made)])
    race: dict[str, list[Result]] = {}

    def finish() -> None:
        record = {view: [result.record() for result in results] for view, results in race.items()}
        plan.output.print({**plan.record(), "views": record}, [race_grid(race, levels, how)])

    total = len(subjects) * len(entries) * len(counts) * plan.seeds
    with printed_at_last(race, finish), progress_bar("rendering", total, "pictures") as progress:
        for target, results in run_race(
            subjects, entries, counts, enough=max(levels), seeds=plan.seeds, progress=progress
        ):
            race[target.name] = results
            curves = [result.curve for found in race.values() for result in found]
            report.grids = [race_grid(race, levels, ()), convergence_grid(curves)]
            report.plots = convergence_plots(curves)
            report.figures += race_figures(target, results)
            plan.output.write(report)
    return 0


def _conditions(plan: Measurement) -> str:
    """Return the sizes, devices and seeds of a race as one line."""
    sizes = ", ".join(f"{t.name} {t.view.width}x{t.view.height}" for t in plan.targets)
    return (
        f"{sizes}; iprt on {plan.device.name}, Mitsuba and Open Image Denoise on "
        f"{counted(os.cpu_count() or 1, 'core')}; {counted(plan.seeds, 'seed')}."
    )
