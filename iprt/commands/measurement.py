"""Subject and output of the verbs that score still pictures against the truth."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Iterator, Sequence, Sized
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.errors import IprtError
from iprt.files.message_text import counted
from iprt.files.termination import at_termination
from iprt.measure.protocol import provenance, provenance_line
from iprt.measure.report import Report
from iprt.measure.sweep import Combination
from iprt.measure.view_truth import Background, Target, read_target, views_with_truth
from iprt.output.grid import Grid, print_grid
from iprt.scene.scene import Scene

LOG = logging.getLogger("iprt.bench")
MANY = 10
"""Largest number of results that a terminal shows with all their passes."""


@dataclass(frozen=True)
class Measurement:
    """Subject, device and output of a measurement; `made` is its `provenance`."""

    scene: Scene
    made: dict[str, Any]
    targets: tuple[Target, ...]
    chosen: tuple[Combination, ...]
    seeds: int
    background: Background
    device: ComputeDevice
    output: Output

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
        output: Output,
    ) -> Measurement:
        """Read the truths and open the device."""
        names = dict.fromkeys(views_with_truth(scene, views))
        targets = tuple(read_target(scene, name, background, size) for name in names)
        compute = ComputeDevice(choose_device(device))
        made = provenance(scene)
        return cls(scene, made, targets, tuple(chosen), seeds, background, compute, output)

    def announce(self, what: str) -> None:
        """Log the number of runs that follow; `what` describes each."""
        LOG.info(
            "%s: %s of settings, %s, %s; %s",
            counted(len(self.chosen) * len(self.targets) * self.seeds, "run"),
            counted(len(self.chosen), "combination"),
            counted(len(self.targets), "view"),
            counted(self.seeds, "seed"),
            what,
        )

    def lines(self) -> list[str]:
        """Return lines for a page about the conditions of the measurement."""
        sizes = ", ".join(f"{t.name} {t.view.width}x{t.view.height}" for t in self.targets)
        return [
            f"{sizes}; on {self.device.name}.",
            f"Scored over the background of the {self.background}, {counted(self.seeds, 'seed')}. "
            "SSIM, FLIP: as displayed. RMSE: linear radiance.",
            provenance_line(self.made),
        ]

    def record(self) -> dict[str, Any]:
        """Return the conditions of the measurement as plain data."""
        return {
            **self.made,
            "device": self.device.name,
            "background": self.background,
            "seeds": self.seeds,
        }


@dataclass(frozen=True)
class Output:
    """Output of results: to stdout as JSON, Markdown or tables, and to a page."""

    json: bool
    markdown: bool
    html: Path | None

    def write(self, report: Report) -> None:
        """Write the page, if `html` names one."""
        if self.html is not None:
            report.write(self.html)

    def print(self, record: dict[str, Any], grids: Sequence[Grid]) -> None:
        """Print the JSON object or the tables; `record` includes the `provenance`."""
        if self.json:
            print(json.dumps(record, indent=2))
            return
        *others, last = grids
        grids = [*others, replace(last, notes=(*last.notes, provenance_line(record)))]
        for index, grid in enumerate(grids):
            if self.markdown and index:
                print()
            print_grid(grid, markdown=self.markdown)


def parse_levels(text: str) -> list[float]:
    """Parse values of SSIM separated by commas.

    Raises
    ------
    IprtError
        A value is no number above 0 and at most 1.
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
    """Call `finish` at the end of the block, on a signal or an error too if there are results."""

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
