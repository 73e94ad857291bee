"""`iprt bench` against truth: measure, print, and write a page."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Iterator, Sequence, Sized
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from iprt.commands.progress import progress_bar
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.errors import IprtError
from iprt.files.atomic import require_writable
from iprt.files.termination import at_termination
from iprt.files.wording import counted
from iprt.measure.claims import Verdict, claims_grid, run_claims
from iprt.measure.convergence import Curve, parse_counts, run_convergence
from iprt.measure.convergence_report import convergence_grid, convergence_plots, reach_grid
from iprt.measure.equal_time import (
    EqualTime,
    costs_grid,
    equal_time_figures,
    equal_time_grid,
    parse_seconds,
    run_equal_time,
)
from iprt.measure.protocol import provenance, provenance_line
from iprt.measure.published import CLAIMS
from iprt.measure.report import Report
from iprt.measure.sweep import Combination, Outcome, frames_per_view, run_sweep
from iprt.measure.sweep_report import passes_grid, sweep_figures, sweep_grid, sweep_plots
from iprt.measure.view_truth import Background, Target, read_target, views_with_truth
from iprt.output.grid import Grid, print_grid
from iprt.scene.scene import Scene

LOG = logging.getLogger("iprt.bench")
MANY = 10
"""Outcomes that a terminal has room for with all their passes."""


@dataclass(frozen=True)
class Plan:
    """Subject and device of a measurement; `made` is its `provenance`."""

    scene: Scene
    made: dict[str, Any]
    targets: tuple[Target, ...]
    chosen: tuple[Combination, ...]
    seeds: int
    background: Background
    device: ComputeDevice

    @classmethod
    def of(
        cls,
        scene: Scene,
        views: Sequence[str],
        size: tuple[int, int] | None,
        background: Background,
        device: str | None,
        chosen: Sequence[Combination],
        seeds: int,
    ) -> Plan:
        """Read the truths and take the device."""
        names = dict.fromkeys(views_with_truth(scene, views))
        targets = tuple(read_target(scene, name, background, size) for name in names)
        compute = ComputeDevice(choose_device(device))
        return cls(scene, provenance(scene), targets, tuple(chosen), seeds, background, compute)

    def announce(self, what: str) -> None:
        """Say on stderr what is going to be run."""
        LOG.info(
            "%s: %s of settings, %s, %s; %s",
            counted(len(self.chosen) * len(self.targets) * self.seeds, "run"),
            counted(len(self.chosen), "combination"),
            counted(len(self.targets), "view"),
            counted(self.seeds, "seed"),
            what,
        )

    def lines(self) -> list[str]:
        """How the figures were made, for a page."""
        sizes = ", ".join(f"{t.name} {t.view.width}x{t.view.height}" for t in self.targets)
        return [
            f"{sizes}; on {self.device.name}.",
            f"Scored over the background of the {self.background}, {counted(self.seeds, 'seed')}. "
            "SSIM, FLIP: as displayed. RMSE: linear radiance.",
            provenance_line(self.made),
        ]

    def record(self) -> dict[str, Any]:
        """The same as plain data."""
        return {
            **self.made,
            "device": self.device.name,
            "background": self.background,
            "seeds": self.seeds,
        }


@dataclass(frozen=True)
class Output:
    """Where results go: to stdout as JSON, Markdown or tables, and to a page."""

    json: bool
    markdown: bool
    html: Path | None

    def require_writable(self, scene: Scene) -> None:
        """Fail before anything is measured if the page cannot be written.

        Raises
        ------
        IprtError
        """
        if self.html is not None:
            require_writable(self.html)
            scene.require_not_ours(self.html)

    def write(self, report: Report) -> None:
        if self.html is not None:
            report.write(self.html)

    def print(self, record: dict[str, Any], grids: Sequence[Grid]) -> None:
        """`record` holds the `provenance`."""
        if self.json:
            print(json.dumps(record, indent=2))
            return
        *others, last = grids
        grids = [*others, replace(last, notes=(*last.notes, provenance_line(record)))]
        for index, grid in enumerate(grids):
            if self.markdown and index:
                print()
            print_grid(grid, markdown=self.markdown)


def measure_sweep(plan: Plan, frames: int, output: Output) -> int:
    """Sweep, print, and write the page anew after every outcome, so that nothing gets lost."""
    plan.announce(f"{counted(frames, 'frame')} each")
    report = Report(f"{plan.scene.name}: speed and accuracy", plan.lines())
    outcomes: list[Outcome] = []
    total = len(plan.targets) * frames_per_view(len(plan.chosen), frames, plan.seeds)

    def finish() -> None:
        grids = [sweep_grid(outcomes)]
        if len(outcomes) <= MANY and not output.markdown:
            grids.append(passes_grid(outcomes))
        rows = [outcome.record() for outcome in outcomes]
        output.print({**plan.record(), "frames": frames, "rows": rows}, grids)

    with printed_at_last(outcomes, finish), progress_bar("sweeping", total) as progress:
        for outcome, color in run_sweep(
            plan.scene,
            plan.targets,
            plan.chosen,
            device=plan.device,
            frames=frames,
            seeds=plan.seeds,
            progress=progress,
        ):
            outcomes.append(outcome)
            if output.html is not None:
                report.grids = [sweep_grid(outcomes), passes_grid(outcomes)]
                report.plots = sweep_plots(outcomes)
                report.figures.append(sweep_figures(len(outcomes), outcome, color))
                output.write(report)
    return 0


def measure_convergence(plan: Plan, text: str, reach: str, output: Output) -> int:
    """Follow pictures as they get better, print, and write the page anew after every curve."""
    counts, levels = parse_counts(text), parse_levels(reach)
    plan.announce(f"{counted(counts[-1], 'frame')} each")
    report = Report(f"{plan.scene.name}: accuracy against time", plan.lines())
    curves: list[Curve] = []

    def finish() -> None:
        record = {**plan.record(), "curves": [curve.record() for curve in curves]}
        output.print(record, [convergence_grid(curves), reach_grid(curves, levels)])

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
            output.write(report)
    return 0


def measure_equal_time(plan: Plan, text: str, frames: int, output: Output) -> int:
    """Render with each of the settings for equal times, print, and write the page as it goes."""
    budgets = parse_seconds(text)
    plan.announce(f"{text} s per picture, then {counted(frames, 'frame')}")
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
            frames=frames,
            progress=progress,
        ):
            results.append(result)
            if output.html is not None:
                report.grids = [costs_grid(results), equal_time_grid(results)]
                report.figures.append(equal_time_figures(result, colors))
                output.write(report)
    return 0


def measure_claims(plan: Plan, frames: int, output: Output) -> int:
    """Measure what papers claim, print, and write the page."""
    plan.announce("claims of papers")
    report = Report(f"{plan.scene.name}: claims of papers", plan.lines())
    verdicts: list[Verdict] = []

    def finish() -> None:
        record = {**plan.record(), "claims": [verdict.record() for verdict in verdicts]}
        output.print(record, [claims_grid(verdicts)])

    total = len(plan.targets) * len(CLAIMS)
    with printed_at_last(verdicts, finish), progress_bar("measuring", total) as progress:
        for verdict in run_claims(
            plan.scene, plan.targets, CLAIMS, device=plan.device, frames=frames, progress=progress
        ):
            verdicts.append(verdict)
            report.grids = [claims_grid(verdicts)]
            output.write(report)
    return 0


def parse_levels(text: str) -> list[float]:
    """Values of SSIM separated by commas.

    Raises
    ------
    IprtError
        One is none.
    """
    try:
        levels = [float(word) for word in text.split(",")]
        if not all(math.isfinite(level) and 0.0 < level <= 1.0 for level in levels):
            raise ValueError
    except ValueError:
        raise IprtError(
            f"--reach {text}: expected values of SSIM, above 0 and at most 1, such as 0.9,0.95"
        ) from None
    return levels


@contextmanager
def printed_at_last(results: Sized, finish: Callable[[], None]) -> Iterator[None]:
    """Print what there is at the end, be it a signal or an error: no result is lost."""

    def finish_early() -> None:
        if results:
            finish()

    try:
        with at_termination(finish_early):
            yield
    except Exception:
        finish_early()
        raise
    finish()
