"""The noise of a still picture, and when there is little enough of it.

Noise is the standard error of the picture as displayed (`iprt.output.display`, in the scene's
exposure): the root of the mean of its squared error, over the channels of all pixels that are not
the same from frame to frame, where 1 is white. One step of 8 bits is 0.004. Linear radiance would
not do: its error is that of the few pixels that reflect a lamp, far beyond white. Nor would all
pixels: those of the video that no object touches have no noise, however many they are.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from iprt.output.display import Image, display

Picture = NDArray[np.float32]


class Convergence:
    """Estimates the noise of a mean of frames from how it changed while their number doubled.

    Means of n and of 2n frames differ by half of the second's frames: the variance of their
    difference is that of the second mean. So the pictures suffice; no pass is involved. What more
    frames do not take away, such as the error of what the panorama does not show, is no noise.

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
        """The estimate after so many frames; each picture at rest is to be added, from the first.

        Between doublings it is taken to fall with the root of the number of frames.

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
    """Root mean square over the pixels that differ; 0 where none does."""
    squares = np.square(a - b)[(a != b).any(axis=2)]
    return float(np.sqrt(squares.mean())) if squares.size else 0.0


class Goal:
    """Tells when a still picture has converged: its noise, as of `Convergence`, is small enough.

    The picture is looked at whenever the number of its frames has doubled. What the filter leaves
    falls more slowly than with the root of that number, so that it cannot be known before.

    Parameters
    ----------
    noise : float
        Above 0.
    most_frames : int
        After these it ends all the same.
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
        """The picture has converged."""
        return self.reached is not None and self.reached <= self.noise

    @property
    def next_frames(self) -> int:
        """Number of frames after which to look at the picture next; the present one: no more."""
        if self.met:
            return self.frames
        return min(max(2 * self.frames, 1), self.most_frames)

    def add(self, frames: int, picture: Picture) -> None:
        """Take note of the picture after so many frames."""
        self.frames = frames
        self.reached = self._convergence.add(frames, picture)
