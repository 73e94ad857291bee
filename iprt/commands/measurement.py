"""Output of the verbs that measure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from iprt.errors import IprtError
from iprt.files.termination import at_termination
from iprt.measure.protocol import provenance_line
from iprt.measure.report import Figures, Report
from iprt.measure.results import json_text
from iprt.output.grid import print_grid

Result = TypeVar("Result")


@dataclass(frozen=True)
class Output:
    """Output of results: to stdout as JSON, Markdown or tables, and to a page."""

    json: bool
    markdown: bool
    html: Path | None

    def collect(
        self,
        results: Iterable[tuple[Result, Callable[[], Sequence[Figures]]]],
        key: str,
        record: dict[str, Any],
        page: Callable[[list[Result]], Report],
    ) -> list[Result]:
        """Collect results, write the page after each one, and print and return all at the end.

        Results before an error or a signal are printed too.

        Parameters
        ----------
        results : iterable of (result, callable)
            Results with functions that draw their pictures for the page.
        key : str
            Key of the results in the JSON object.
        record : dict
            The other entries of the object, with the `provenance`.
        page : callable
            Builds the page, without pictures, of the results so far, at least one.
        """
        found: list[Result] = []
        figures: list[Figures] = []
        with printed_at_last(found, lambda: self.print({**record, key: found}, page(found))):
            for result, draw in results:
                found.append(result)
                if self.html is not None:
                    figures += draw()
                    report = page(found)
                    report.figures = figures
                    report.write(self.html)
        return found

    def print(self, record: dict[str, Any], report: Report) -> None:
        """Print the JSON object or the report's tables; `record` includes the `provenance`."""
        if self.json:
            print(json_text(record))
            return
        *others, last = report.grids
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
