"""Texts in messages: quantities with their units, and untrusted text."""

from __future__ import annotations

import re

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]")


def counted(number: int, noun: str) -> str:
    """Format a count with its noun: `1 frame`, `2 frames`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def length(metres: float) -> str:
    """Format a length as `2.20 m`, `3.4 cm` or `1.2 km`."""
    if metres >= 1000.0:
        return f"{metres / 1000.0:.3g} km"
    return f"{metres:.2f} m" if metres >= 0.995 else f"{100.0 * metres:.1f} cm"


def extent(size: tuple[int, int]) -> str:
    """Return a width and height as text."""
    return f"{size[0]} x {size[1]}"


def printable(text: str, most: int = 300) -> str:
    """Return a text for an error message, without control characters and of limited length."""
    shown = _CONTROL.sub(lambda match: repr(match[0])[1:-1], text[: 2 * most])
    return shown if len(shown) <= most else f"{shown[: most - 3]}..."
