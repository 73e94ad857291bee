"""The picture in a window, and its pixels' values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.output.tone import Bytes
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
        What it was made from; `shown.picture` is linear.
    buffer : str or None
        The auxiliary picture that the pixels show.
    caption : str
        What the pixels show: a buffer, a comparison and how alike the two are; empty for the
        picture alone.
    warning : str
        Why a comparison misleads; empty if it does not.
    sides : (str, str) or None
        What is left and right of the lens's split. None: the pixels are not divided.
    preview : Preview or None
        What it lacks to hold the frame rate asked for. None: nothing.
    latency_s : float or None
        From the newest input that it answers, to it. None: nothing moves.
    latency_frames : int or None
        The same in view frames of this window.
    fps : float or None
        Pictures per second, of late. None: nothing moves, or it has only begun to.
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
        Pixel of the picture as it was rendered.
    radiance : (3,) float32
        Linear.
    buffer : str or None
        The auxiliary picture that is shown.
    value : (1..3,) float32 or None
        What that picture holds there, in `unit`.
    unit : str
    depth_m : float or None
        From the capture centre, of what is seen; +inf: open sky. None: not known in motion.
    normal : (3,) float64 or None
        In the world; None: open sky, or not known.
    name : str or None
        Name of the object there.
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
        """Labels and values, in words, with units."""
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
