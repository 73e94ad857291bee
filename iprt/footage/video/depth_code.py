"""Stored values of depth to metres."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from iprt.errors import FormatError

Picture = NDArray[np.float32]

MAX_WHITE = 1.01
"""Floats that go from 0 to 1 are no larger."""


@dataclass(frozen=True)
class DepthCode:
    """The meaning of stored values. A value of 0, or black, is no surface in any case.

    Attributes
    ----------
    scale : float or None
        Metres per stored unit.
    ends : (float, float) or None
        Metres that black and white stand for.
    encoding : "linear" or "inverse"
        Between `ends`, whether depth or its inverse grows in proportion with the stored value.
    """

    scale: float | None = None
    ends: tuple[float, float] | None = None
    encoding: Literal["linear", "inverse"] = "linear"

    @property
    def is_known(self) -> bool:
        """Whether integers can be converted to metres."""
        return self.scale is not None or self.ends is not None

    def describe(self) -> str:
        """As text."""
        if self.ends is None:
            return f"{self.scale or 1.0:g} m per stored unit"
        grows = "depth" if self.encoding == "linear" else "1 / depth"
        return f"{self.ends[0]:g} m at black to {self.ends[1]:g} m at white, even in {grows}"

    def require_range(self, path: Path, stored: NDArray[Any]) -> None:
        """Raise FormatError where `ends` are given for floats that go beyond 1: metres, mostly."""
        if self.ends is None or stored.dtype.kind != "f":
            return
        most = float(np.max(stored, initial=0.0, where=np.isfinite(stored)))
        if most > MAX_WHITE:
            raise FormatError(
                f"{path}: stores floats up to {most:.4g}, but a depth range (depth_range) is for "
                "values from 0 to 1; leave it out where depth is stored in metres"
            )

    def metres(self, stored: NDArray[Any], black: float, white: float) -> Picture:
        """Metres (H, W); 0, negative, NaN or inf where there is no surface.

        Parameters
        ----------
        stored : (H, W) of any type
        black, white : float
            Stored values of both, which only `ends` looks at.
        """
        value = stored.astype(np.float32, copy=False)
        with np.errstate(all="ignore"):
            if self.ends is None:
                return value if self.scale in (None, 1.0) else value * np.float32(self.scale)
            part = (value - np.float32(black)) * np.float32(1.0 / (white - black))
            low, high = self.ends
            if self.encoding == "inverse":
                low, high = 1.0 / low, 1.0 / high
            mixed = np.float32(low) + part * np.float32(high - low)
            metres = 1.0 / mixed if self.encoding == "inverse" else mixed
            return np.where(part > 0.0, metres, np.float32(0.0))


def unit_problem(name: str) -> str:
    """The message that a file needs a `depth_scale` or `depth_range`."""
    return (
        f"video.depth_scale: {name} stores integers; say how many metres one step is "
        "(0.001 for millimetres), or give depth_range, the metres of black and of white"
    )
