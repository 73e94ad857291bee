"""Findings of a verb, printed as lines of text or as one JSON object."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any


class Findings:
    """Facts, notes and warnings, in the order in which they are printed.

    Attributes
    ----------
    warnings : list of str
        Warnings so far.
    """

    def __init__(self, **facts: Any) -> None:
        """Start with `facts` for the JSON object."""
        self.warnings: list[str] = []
        self._facts = facts
        self._notes: list[str] = []
        self._lines: list[str] = []

    def say(self, line: str, **facts: Any) -> None:
        """Add a line of text, and its content as facts for the JSON object."""
        self._lines.append(line)
        self._facts |= facts

    def note(self, lines: Iterable[str]) -> None:
        """Add notes."""
        for line in lines:
            self._notes.append(line)
            self._lines.append(f"note: {line}")

    def warn(self, lines: Iterable[str]) -> None:
        """Add warnings."""
        for line in lines:
            self.warnings.append(line)
            self._lines.append(f"warning: {line}")

    def print(self, *, as_json: bool) -> None:
        """Print all findings to stdout."""
        if as_json:
            record = {**self._facts, "notes": self._notes, "warnings": self.warnings}
            print(json.dumps(record, indent=2, ensure_ascii=False))
        else:
            print("\n".join(self._lines))
