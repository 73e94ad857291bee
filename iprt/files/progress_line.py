"""Lines that tell another program how far a render is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Self

_LINE = re.compile(r"progress (\d+)/(\d+)(.*)")


@dataclass(frozen=True)
class ProgressLine:
    """A line such as `progress 3/64, noise 0.02`.

    Attributes
    ----------
    done, total : int
        Finished frames, and all.
    note : str
        Present activity, or the result: `: compiling march.cl`, `, noise 0.02`.
    """

    done: int
    total: int
    note: str = ""

    def __str__(self) -> str:
        return f"progress {self.done}/{self.total}{self.note}"

    @classmethod
    def of(cls, text: str) -> Self | None:
        """Return the parsed line; None if it is another one."""
        found = _LINE.fullmatch(text)
        return None if found is None else cls(int(found[1]), int(found[2]), found[3])
