"""Light from outside that no camera saw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from iprt.footage.sky import Sky
from iprt.footage.sun import Sun

SunChoice = Sun | Literal["auto"] | None
"""A known sun, "auto" to look for one, or None for none."""


@dataclass(frozen=True)
class OutsideLight:
    """The sun that lights a frame, and the sky behind its windows.

    Attributes
    ----------
    sun : Sun or None
    sky : Sky or None
    doubt : str
        Why no sun was found, if one was looked for; else empty.
    """

    sun: Sun | None = None
    sky: Sky | None = None
    doubt: str = ""
