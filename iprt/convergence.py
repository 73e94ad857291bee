"""Noise of a static picture, and convergence to a given noise.

Noise is the standard error of the displayed picture (`iprt.output.display`, in the scene's
exposure), where 1 is white. It is the root mean square over the channels of all pixels that differ
between frames. One step of 8 bits is 0.004. Linear radiance is unsuitable: the few pixels that
reflect a lamp, far beyond white, would dominate its error. All pixels are unsuitable too: pixels of
the video that no object touches have no noise, however many there are.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from iprt.output.display import Image, display

Picture = NDArray[np.float32]


class Convergence:
    """Estimator of the noise of a mean of frames, from its change while their number doubled.

    Means of n and of 2n frames differ by half of the difference of their halves: the variance of
    their difference equals the second mean's. So the pictures suffice, without access to a pass.
    Errors that more frames do not reduce, such as surfaces missing in the panorama, are not noise.

    Parameters
    ----------
    exposure : float
        The scene's.
    """

    def __init__(self, exposure: float) -> None:
        self._exposure = exposure
        self._frames = 0
        self._before: Image | None = None
        self._measured: tuple[int, float] | None = None

    def add(self, frames: int, picture: Picture) -> float | None:
        """Add the picture after `frames` frames, and return the estimate.

        All pictures of a static scene must be added, from the first. Between doublings the noise is
        assumed to fall with the root of the number of frames.

        Returns
        -------
        float or None
            None before the second frame.
        """
        if frames <= 1:
            self._measured, self._before, self._frames = None, None, 0
        if frames >= 2 * self._frames:
            now = display(picture, self._exposure)
            if self._before is not None:
                self._measured = frames, _difference(now, self._before)
            self._before, self._frames = now, frames
        if self._measured is None:
            return None
        measured_at, noise = self._measured
        return noise * math.sqrt(measured_at / frames)


def _difference(a: Image, b: Image) -> float:
    """Return the root mean square over the pixels that differ; 0 where none does."""
    squares = np.square(a - b)[(a != b).any(axis=2)]
    return float(np.sqrt(squares.mean())) if squares.size else 0.0


class Goal:
    """Goal of a static picture: its noise, as defined in `Convergence`, is small enough.

    The picture is examined whenever the number of its frames has doubled. The filter's residual
    falls more slowly than with the root of that number, so that it cannot be predicted.

    Parameters
    ----------
    noise : float
        Above 0.
    most_frames : int
        Limit on the number of frames.
    exposure : float
        The scene's.

    Attributes
    ----------
    frames : int
        Of the last picture.
    reached : float or None
        Its noise. None before the second frame.
    """

    def __init__(self, noise: float, most_frames: int, exposure: float) -> None:
        self.noise, self.most_frames = noise, most_frames
        self.frames = 0
        self.reached: float | None = None
        self._convergence = Convergence(exposure)

    @property
    def met(self) -> bool:
        """True if the picture has converged."""
        return self.reached is not None and self.reached <= self.noise

    @property
    def next_frames(self) -> int:
        """Number of frames after which to examine the picture next; the present one: no more."""
        if self.met:
            return self.frames
        return min(max(2 * self.frames, 1), self.most_frames)

    def add(self, frames: int, picture: Picture) -> None:
        """Record the picture after `frames` frames."""
        self.frames = frames
        self.reached = self._convergence.add(frames, picture)
