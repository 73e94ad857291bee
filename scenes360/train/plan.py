"""What moves in the clip, and how: pure functions of the time in seconds.

The room and its axes are those of `scenes360.room.plan`.
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
"""Places of the locomotive's middle, at the first and the last frame."""
WHEEL = 0.065

BALL_RADIUS = 0.13
BALL_PATH = ((1.05, -1.30), (-0.85, -1.24))
"""x and z of the hopping ball, at the first and the last frame."""
HOPS, HOP_HEIGHT = 3, 0.24
KNOT_PLACE = (0.42, RUG, -1.72)
KNOT_TURN_DEG = 300.0

Matrix = NDArray[np.float64]


def train_x(time_s: float) -> float:
    """Where the middle of the locomotive is; it rolls at a constant speed."""
    start, stop = TRAIN_X
    return start + (stop - start) * time_s / LAST_S


def at(place: tuple[float, float, float]) -> Matrix:
    """The `to_world` of what stands on y = 0 around its origin, set down at a place."""
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return matrix


def key_times() -> list[float]:
    """Each frame's: the inserted objects have a keyframe at each."""
    return [index / FPS for index in range(FRAMES)]


def ball() -> tuple[Matrix, list[ObjectKeyframe]]:
    """The inserted ball hops along its path: its `to_world`, and keyframes relative to it."""
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
    """The inserted knot turns where it stands."""
    keys = []
    for time_s in key_times():
        half = 0.5 * math.radians(KNOT_TURN_DEG * time_s / LAST_S)
        turn = [0.0, math.sin(half), 0.0, math.cos(half)]
        keys.append(ObjectKeyframe(time=_short(time_s), rotation=[*map(_short, turn)]))
    return at(KNOT_PLACE), keys


def _short(value: float) -> float:
    """As it is written to scene.toml."""
    return round(value, 5) + 0.0
