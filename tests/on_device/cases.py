"""What a step is made of, for its module and for the process that runs it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

Value = str | float | int | dict[str, Any] | None
Row = dict[str, Value]
"""A row of a table, by column. A mapping is kept in the results, and not shown."""


@dataclass(frozen=True)
class Asked:
    """What a step is asked for.

    Attributes
    ----------
    device : str
        As `iprt.device.choose.choose` takes it.
    until : float
        When the step ends, in seconds of `time.monotonic`, which all processes share.
    """

    device: str
    until: float


Case = Callable[[], list[Row]]
Cases = Mapping[str, Case]
"""By name, the most valuable first."""
