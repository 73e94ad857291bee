"""Changes between two timings, with a test of their significance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from iprt.errors import IprtError
from iprt.geometry.camera import View
from iprt.measure.cost import BLOCKS, Timing
from iprt.measure.cost_report import CostReport
from iprt.output.metadata import dotted

FALSE_ALARMS = 0.05
"""Probability that at least one row is marked although nothing has changed."""
MIN_ERROR_MS = 1e-3
"""Resolution of device clocks."""
WALL, FRAME = "wall", "all passes"
"""Names of the rows of the whole frame."""


@dataclass(frozen=True)
class Change:
    """The difference of a time.

    Attributes
    ----------
    name, part : str
        Name of the pass, or `WALL` or `FRAME`. `part` is the kernel, transfer or host work in it,
        or empty.
    before_ms, after_ms : float or None
        Medians. None: the pass or part did not run.
    noise_ms : float or None
        Differences up to this are not significant. None: unknown, too few frames.
    """

    name: str
    part: str
    before_ms: float | None
    after_ms: float | None
    noise_ms: float | None

    @property
    def difference_ms(self) -> float:
        """Time after minus time before."""
        return (self.after_ms or 0.0) - (self.before_ms or 0.0)

    @property
    def beyond_noise(self) -> bool:
        """True if the difference exceeds the known noise, or the row is new or gone."""
        if self.before_ms is None or self.after_ms is None:
            return True
        return self.noise_ms is not None and abs(self.difference_ms) > self.noise_ms


def require_comparable(old: CostReport, *, scene: str, device: str, view: View) -> None:
    """Check that scene, device and view of an earlier report are the given ones.

    Raises
    ------
    IprtError
        They differ; the message says in which respect. The caller adds the file's name.
    """
    for what, before, now in (
        ("scene", old.scene, scene),
        ("device", old.device, device),
        *((key, getattr(old.view, key), value) for key, value in asdict(view).items()),
    ):
        if before != now:
            raise IprtError(f"was measured with {what} {before}, not {now}; measure it again")


def changes(old: CostReport, new: CostReport) -> list[Change]:
    """Return the changes of all rows, in the order of `new`; rows only in `old` come last."""
    before, after = dict(_rows(old)), dict(_rows(new))
    places = [*after, *(place for place in before if place not in after)]
    count = sum(_error(before.get(place), after.get(place)) is not None for place in places)
    return [_change(place, before.get(place), after.get(place), count) for place in places]


def changed_settings(old: CostReport, new: CostReport) -> list[str]:
    """Describe the settings that differ."""
    before, after = dotted(old.settings), dotted(new.settings)
    return [
        f"{key} = {after.get(key)}, was {before.get(key)}"
        for key in dict.fromkeys([*after, *before])
        if before.get(key) != after.get(key)
    ]


def _change(
    place: tuple[str, str], before: Timing | None, after: Timing | None, count: int
) -> Change:
    from scipy.stats import t

    error, noise = _error(before, after), None
    if error is not None:
        # Welch's t-test of medians over blocks, with Bonferroni's correction for `count` tests.
        # Its degrees of freedom are at least BLOCKS - 1, the value of the noisier run.
        noise = float(t.isf(0.5 * FALSE_ALARMS / count, BLOCKS - 1)) * error
    return Change(
        *place,
        before_ms=None if before is None else before.ms,
        after_ms=None if after is None else after.ms,
        noise_ms=noise,
    )


def _error(before: Timing | None, after: Timing | None) -> float | None:
    """Return the standard error of the difference in ms, or None if unknown."""
    if before is None or after is None or before.error_ms is None or after.error_ms is None:
        return None
    return max(math.hypot(before.error_ms, after.error_ms), MIN_ERROR_MS)


def _rows(report: CostReport) -> Iterator[tuple[tuple[str, str], Timing]]:
    if report.wall is not None:
        yield (WALL, ""), report.wall
    yield (FRAME, ""), report.frame
    for row in report.passes:
        yield (row.name, ""), row.timing
        for part in row.parts:
            yield (row.name, part.name), part.timing
