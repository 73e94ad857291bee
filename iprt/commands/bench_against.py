"""`iprt bench --against`: the seconds that iprt and Mitsuba need for one accuracy."""

from __future__ import annotations

import os

from iprt.commands.bench_truth import Output, Plan, parse_levels, printed_at_last
from iprt.commands.progress import progress_bar
from iprt.files.wording import counted
from iprt.measure.convergence import parse_counts
from iprt.measure.convergence_report import convergence_grid, convergence_plots
from iprt.measure.protocol import provenance_line
from iprt.measure.report import Report
from iprt.measure.time_to_accuracy import Result, run_race
from iprt.measure.time_to_accuracy_report import race_figures, race_grid
from iprt.measure.timed_renderers import Entry, FullEntry, IprtEntry, PanoramaEntry, Subject
from iprt.truth.model import load_parts


def measure_against(
    plan: Plan,
    text: str,
    reach: str,
    model: str | None,
    output: Output,
    *,
    device: str | None,
    allow_outside: bool,
) -> int:
    """Let iprt and Mitsuba take turns, print, and write the page anew after every view.

    `device` and `allow_outside` are as for `Plan`, for the processes.
    """
    counts, levels = parse_counts(text), parse_levels(reach)
    entries: list[Entry] = [IprtEntry(chosen, device) for chosen in plan.chosen]
    if model is not None:
        load_parts(model)  # a fault is said before anything is measured
        entries.append(FullEntry(model))
    entries.append(PanoramaEntry())
    subjects = [Subject(plan.scene.root, allow_outside, target) for target in plan.targets]
    plan.announce(f"up to {counted(counts[-1], 'frame')} or samples per pixel each")
    how = _conditions(plan)
    report = Report(f"{plan.scene.name}: against Mitsuba", [*how, provenance_line(plan.made)])
    race: dict[str, list[Result]] = {}

    def finish() -> None:
        record = {view: [result.record() for result in results] for view, results in race.items()}
        output.print({**plan.record(), "views": record}, [race_grid(race, levels, how)])

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
            output.write(report)
    return 0


def _conditions(plan: Plan) -> list[str]:
    sizes = ", ".join(f"{t.name} {t.view.width}x{t.view.height}" for t in plan.targets)
    return [
        f"{sizes}; iprt on {plan.device.name}, Mitsuba and Open Image Denoise on "
        f"{counted(os.cpu_count() or 1, 'core')}; {counted(plan.seeds, 'seed')}.",
    ]
