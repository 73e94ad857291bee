"""Smooth interpolation of keyframes.

Between two keys a quantity follows a cubic Hermite curve. Rotations follow one in the rotation
vectors from the earlier key, whose rates are angular velocities; see e.g. Kim, Kim, Shin: A General
Construction Scheme for Unit Quaternion Curves with Simple High Order Derivatives (1995).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from iprt.geometry.animation import Track

Float = NDArray[np.float64]
Interpolation = Literal["linear", "smooth", "step"]
"""Interpolation from a key to the next."""
STEEPEST = 3.0
"""Largest rate at a key, relative to the mean rate beside it, with which a cubic curve is
monotonic (Fritsch and Carlson 1980)."""


def smooth_track(
    times: Float, values: Float, how: Sequence[Interpolation], *, rotation: bool, limited: bool
) -> Track:
    """Return the track of keys, some of which are smooth.

    Parameters
    ----------
    times : (K,) float64
        Seconds, strictly ascending.
    values : (K, C) float64
    how : sequence of {"linear", "smooth", "step"}
        Interpolation from each key to the next.
    rotation : bool
        Values are unit quaternions (x, y, z, w).
    limited : bool
        Values never leave the range between their two keys.
    """
    spans, held = np.diff(times)[:, None], np.array([each == "step" for each in how])
    if rotation:
        turns = Rotation.from_quat(values)
        steps = (turns[1:] * turns[:-1].inv()).as_rotvec() if len(times) > 1 else np.zeros((0, 3))
        arriving, leaving = _rates(steps / spans, spans, how, limited=False)
        return TurnTrack(times, values, held, True, steps, arriving, leaving)
    arriving, leaving = _rates(np.diff(values, axis=0) / spans, spans, how, limited=limited)
    return Track(times, np.stack([arriving, values, leaving], axis=1), held)


def _rates(
    means: Float, spans: Float, how: Sequence[Interpolation], *, limited: bool
) -> tuple[Float, Float]:
    """Return the rates (K, C) with which a curve arrives at its keys, and leaves them.

    They are equal, except where a key is a corner by choice. A curve that is smooth on both sides
    has the rate of the parabola through the neighbours there (Catmull-Rom for even times); next to
    a linear part it has the rate of that, and next to rest none.

    Parameters
    ----------
    means : (K - 1, C) float64
        Mean rates between the keys.
    spans : (K - 1, 1) float64
        Seconds between the keys.
    how : sequence of {"linear", "smooth", "step"}
    limited : bool
        Do not overshoot.
    """
    keys, parts = len(means) + 1, means.shape[1]
    arriving, leaving = np.zeros((keys, parts)), np.zeros((keys, parts))
    # Before the first key and after the last one everything rests.
    sides = ["step", *how[: keys - 1], "step"]
    padded = np.pad(means, ((1, 1), (0, 0)))
    for key, (before, after) in enumerate(pairwise(sides)):
        earlier, later = padded[key], padded[key + 1]
        if before == after == "smooth":
            one, other = spans[key - 1], spans[key]
            rate = (other * earlier + one * later) / (one + other)
        elif "linear" in (before, after):
            rate = earlier if before == "linear" else later
        else:
            rate = np.zeros(parts)
        if limited:
            near = [m for m, side in ((earlier, before), (later, after)) if side == "smooth"]
            rate = _limited(rate, near)
        arriving[key] = earlier if before == "linear" else rate
        leaving[key] = later if after == "linear" else rate
    return arriving, leaving


def _limited(rate: Float, means: Sequence[Float]) -> Float:
    """Return a rate (C,) with which no curve of these mean rates (C,) overshoots."""
    for mean in means:
        ends = np.sort([np.zeros_like(mean), STEEPEST * mean], axis=0)
        rate = np.clip(rate, *ends)
    return rate


@dataclass(frozen=True)
class TurnTrack(Track):
    """A keyframed rotation, in part smooth.

    Attributes
    ----------
    steps : (K - 1, 3) float64
        Rotation vectors from each key to the next, along the shorter arc.
    arriving, leaving : (K, 3) float64
        Angular velocities before and after each key, radians per second.
    """

    steps: Float = field(default_factory=lambda: np.zeros((0, 3)))
    arriving: Float = field(default_factory=lambda: np.zeros((0, 3)))
    leaving: Float = field(default_factory=lambda: np.zeros((0, 3)))

    def _between(self, key: int, part: float, duration: float) -> Float:
        step = self.steps[key]
        start, end = self.leaving[key], _rate_of_vector(step, self.arriving[key + 1])
        vector = (
            duration * (part**3 - 2 * part**2 + part) * start
            + (3 * part**2 - 2 * part**3) * step
            + duration * (part**3 - part**2) * end
        )
        turned = Rotation.from_rotvec(vector) * Rotation.from_quat(self.values[key])
        return np.asarray(turned.as_quat())


def _rate_of_vector(vector: Float, rate: Float) -> Float:
    """Return the rate (3,) of a rotation vector at an angular velocity (3,) in fixed axes."""
    angle = float(np.linalg.norm(vector))
    small = angle < 1e-4
    curved = 1.0 / 12.0 if small else angle**-2 - 0.5 / (angle * np.tan(0.5 * angle))
    across = np.cross(vector, rate)
    return np.asarray(rate - 0.5 * across + curved * np.cross(vector, across))
