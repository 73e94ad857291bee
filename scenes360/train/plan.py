"""Motion in the clip, as pure functions of the time in seconds.

Room and axes are as in `scenes360.room.plan`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.keyframes import ObjectKeyframe
from scenes360.room.plan import RUG

FRAMES, FPS = 24, 10.0
LAST_S = (FRAMES - 1) / FPS

TRACK_Z, RAIL_TOP = -0.98, RUG + 0.046
TRAIN_X = (-1.05, 1.20)
"""x of the locomotive's middle at the first and the last frame."""
WHEEL = 0.065

BALL_RADIUS = 0.13
BALL_PATH = ((1.05, -1.30), (-0.85, -1.24))
"""x and z of the hopping ball at the first and the last frame."""
HOPS, HOP_HEIGHT = 3, 0.24
KNOT_PLACE = (0.42, RUG, -1.72)
KNOT_TURN_DEG = 300.0

Matrix = NDArray[np.float64]


def train_x(time_s: float) -> float:
    """Return x of the locomotive's middle; it rolls at a constant speed."""
    start, stop = TRAIN_X
    return start + (stop - start) * time_s / LAST_S


def at(place: tuple[float, float, float]) -> Matrix:
    """Return the `to_world` of an object modelled on y = 0 around its origin, moved to a place."""
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return matrix


def key_times() -> list[float]:
    """Return each frame's time: the inserted objects have a keyframe at each."""
    return [index / FPS for index in range(FRAMES)]


def ball() -> tuple[Matrix, list[ObjectKeyframe]]:
    """Return the hopping ball's `to_world`, and keyframes relative to it."""
    (x0, z0), (x1, z1) = BALL_PATH
    keys = []
    for time_s in key_times():
        share = time_s / LAST_S
        hop = (share * HOPS) % 1.0
        up = 4.0 * HOP_HEIGHT * hop * (1.0 - hop)
        place = [(x1 - x0) * share, up, (z1 - z0) * share]
        keys.append(ObjectKeyframe(time=_short(time_s), translation=[*map(_short, place)]))
    return at((x0, RUG, z0)), keys


def knot() -> tuple[Matrix, list[ObjectKeyframe]]:
    """Return the `to_world` of the knot, which turns in place, and keyframes relative to it."""
    keys = []
    for time_s in key_times():
        half = 0.5 * math.radians(KNOT_TURN_DEG * time_s / LAST_S)
        turn = [0.0, math.sin(half), 0.0, math.cos(half)]
        keys.append(ObjectKeyframe(time=_short(time_s), rotation=[*map(_short, turn)]))
    return at(KNOT_PLACE), keys


def _short(value: float) -> float:
    """Return a value as rounded in scene.toml."""
    return round(value, 5) + 0.0
