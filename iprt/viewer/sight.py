"""What a window shows, and what one of its pixels holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.viewer.session import Shown
from iprt.viewer.tone import Bytes


@dataclass(frozen=True, eq=False)
class Sight:
    """What a window shows.

    Attributes
    ----------
    pixels : (H, W, 3) uint8
        Display-referred.
    shown : Shown
        What it was made from; `shown.picture` is linear.
    caption : str
        What is compared, and how alike they are; empty without a comparison.
    gave_up : str
        What it lacks to hold the frame rate asked for, and what that costs; empty: nothing.
    latency_s : float or None
        From the newest input that it answers, to it.
    latency_frames : int or None
        The same in view frames of this window. None: no input has been answered yet.
    """

    pixels: Bytes
    shown: Shown
    caption: str
    gave_up: str
    latency_s: float | None
    latency_frames: int | None


@dataclass(frozen=True, eq=False)
class Readout:
    """What a pixel holds.

    Attributes
    ----------
    x, y : int
        Of the picture as it was rendered.
    radiance : (3,) float32
        Linear.
    value : (1..3,) float32 or None
        Of the auxiliary picture that is shown, in `unit`.
    unit : str
    depth_m : float or None
        From the capture centre, of what is seen; +inf: open sky. None: not known in motion.
    normal : (3,) float64 or None
        In the world; None: open sky, or not known.
    name : str or None
        Of the object there.
    """

    x: int
    y: int
    radiance: NDArray[np.float32]
    value: NDArray[np.float32] | None
    unit: str
    depth_m: float | None
    normal: NDArray[np.float64] | None
    name: str | None
