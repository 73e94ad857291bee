"""The picture in a window, and the values of its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.output.display import Bytes
from iprt.viewer.labels import BUFFERS
from iprt.viewer.pace import Preview
from iprt.viewer.session import Shown


@dataclass(frozen=True, eq=False)
class DisplayedFrame:
    """The picture in a window.

    Attributes
    ----------
    pixels : (H, W, 3) uint8
        Display-referred.
    shown : Shown
        The rendered picture behind it; `shown.picture` is linear.
    buffer : str or None
        The displayed auxiliary picture, if any.
    caption : str
        Description of a displayed buffer or comparison, with its score; empty for the plain
        picture.
    warning : str
        Reason not to trust a comparison; empty if there is none.
    sides : (str, str) or None
        Names of the pictures left and right of the split; None without a split.
    preview : Preview or None
        Reductions of quality that hold the requested frame rate; None without any.
    latency_s : float or None
        Seconds from the newest answered input to this picture; None at rest.
    latency_frames : int or None
        The same in view frames of this window.
    fps : float or None
        Recent pictures per second; None at rest or at the start of a motion.
    """

    pixels: Bytes
    shown: Shown
    buffer: str | None
    caption: str
    warning: str
    sides: tuple[str, str] | None
    preview: Preview | None
    latency_s: float | None
    latency_frames: int | None
    fps: float | None


@dataclass(frozen=True, eq=False)
class Readout:
    """Values of a pixel.

    Attributes
    ----------
    x, y : int
        Pixel of the rendered picture.
    radiance : (3,) float32
        Linear radiance.
    buffer : str or None
        The displayed auxiliary picture, if any.
    value : (1..3,) float32 or None
        Value of that picture, in `unit`.
    unit : str
    depth_m : float or None
        Distance of the visible surface from the capture centre; +inf for open sky, None if unknown
        during motion.
    normal : (3,) float64 or None
        World-space normal; None for open sky, or if unknown.
    name : str or None
        Name of the object at the pixel.
    """

    x: int
    y: int
    radiance: NDArray[np.float32]
    buffer: str | None
    value: NDArray[np.float32] | None
    unit: str
    depth_m: float | None
    normal: NDArray[np.float64] | None
    name: str | None

    def rows(self) -> list[tuple[str, str]]:
        """Return labels and formatted values with units."""
        rows = [("pixel", f"{self.x}, {self.y}"), ("linear RGB", _numbers(self.radiance))]
        if self.buffer is not None and self.value is not None:
            value = f"{_numbers(self.value)} {self.unit}".rstrip()
            rows.append((BUFFERS[self.buffer].name.lower(), value))
        if self.depth_m is not None:
            far = f"{self.depth_m:.3f} m" if self.depth_m < np.inf else "open sky"
            rows.append(("distance", far))
        if self.normal is not None:
            rows.append(("normal", ", ".join(f"{value:+.2f}" for value in self.normal)))
        if self.name is not None:
            rows.append(("object", self.name))
        return rows


def _numbers(values: NDArray[np.float32]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)
