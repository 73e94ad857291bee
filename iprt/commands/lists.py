"""Flags that take several values: repeated, separated by commas, or both."""

from __future__ import annotations

from collections.abc import Iterable


def listed(values: Iterable[str]) -> tuple[str, ...]:
    """Return the values of a flag in their order: `a,b` twice is a, b, a, b."""
    return tuple(part.strip() for value in values for part in value.split(","))
