"""How far a picture at rest is from the one that it refines to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import LUMINANCE

Picture = NDArray[np.float32]


class Convergence:
    """Estimates the noise of a mean of frames from how it changed while their number doubled.

    Means of n and of 2n frames differ by half of the second's frames: the variance of their
    difference is that of the second mean. So the displayed pictures suffice; no pass is involved.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._before: Picture | None = None
        self._measured: tuple[int, float] | None = None

    def add(self, frames: int, picture: Picture) -> float | None:
        """The estimate after so many frames; each picture at rest is to be added, from the first.

        Returns
        -------
        float or None
            Root of the mean squared error of luminance over the mean luminance. None before the
            second frame.
        """
        if frames <= 1:
            self._measured, self._before, self._frames = None, None, 0
        if frames >= 2 * self._frames:
            if self._before is not None:
                now, before = picture @ LUMINANCE, self._before @ LUMINANCE
                error = float(np.sqrt(np.mean(np.square(now - before, dtype=np.float64))))
                mean = float(now.mean(dtype=np.float64))
                self._measured = frames, error / mean if mean > 0.0 else 0.0
            self._before, self._frames = picture, frames
        if self._measured is None:
            return None
        measured_at, noise = self._measured
        return noise * float(np.sqrt(measured_at / frames))
