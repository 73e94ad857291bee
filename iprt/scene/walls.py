"""Walls that placed objects keep away from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_WALL = 0.9
"""Least horizontal part of a wall's unit normal."""
_KERB = 0.15
"""Share of an object's height below which walls are ignored: depth rounds a wall's foot."""
_TOUCHING = 1e-3
"""Intersection depth that counts as contact, as a fraction of the object's radius."""
_PUSHES = 8
_RINGS, _DIRECTIONS = 12, 24
"""Search for a free place: number of rings, and of places on each."""


class Walls:
    """Points of walls, and the directions away from them.

    Parameters
    ----------
    points : (N, 3) float64
        Points of all real surfaces, metres.
    normals : (N, 3) float64
        Unit vectors.
    centre : (3,) float64
    reach : float
        Horizontal radius around `centre` in which points are kept, metres.
    """

    def __init__(self, points: Array, normals: Array, centre: Array, reach: float) -> None:
        near = np.hypot(*(points - centre)[:, [0, 2]].T) < reach
        sideways = normals[near] * (1.0, 0.0, 1.0)
        length = np.linalg.norm(sideways, axis=1)
        wall = length > _WALL
        self._points = points[near][wall]
        self._out = sideways[wall] / length[wall, None]

    def push(self, base: Array, radius: float, height: float) -> Array:
        """Return the shift (3,) that frees an upright cylinder from the wall it intersects deepest.

        The shift is horizontal, and zero if there is no intersection.
        """
        offset = base - self._points
        level = (-offset[:, 1] > _KERB * height) & (-offset[:, 1] < height)
        cut = level & (np.hypot(*offset[:, [0, 2]].T) < radius)
        if not cut.any():
            return np.zeros(3)
        depth = radius - np.einsum("ij,ij->i", offset[cut], self._out[cut])
        worst = int(depth.argmax())
        shift: Array = self._out[cut][worst] * max(float(depth[worst]), 0.0)
        return shift

    def cut(self, base: Array, radius: float, height: float) -> float:
        """Return the depth of the intersection with a wall in metres; 0 for mere contact."""
        depth = float(np.linalg.norm(self.push(base, radius, height)))
        return depth if depth > _TOUCHING * radius else 0.0

    def free_place(
        self,
        base: Array,
        radius: float,
        height: float,
        reach: float,
        support: Callable[[float, float], float | None],
    ) -> Array | None:
        """Return the base (3,) of a cylinder free of walls, near the chosen place.

        Repeated pushes are tried first. If they do not settle within `reach`, for example between
        two walls, the nearest free place on rings around `base` is taken.

        Parameters
        ----------
        base : (3,) float64
            The chosen place, metres.
        reach : float
            Greatest horizontal distance from there, metres.
        support : callable
            Height of the surface at (x, z), or None without one.

        Returns
        -------
        (3,) float64 or None
            None if no place within reach is free.
        """
        pushed = self._pushed(base, radius, height, support)
        if pushed is not None and np.hypot(*(pushed - base)[[0, 2]]) <= reach:
            return pushed
        for distance in reach * np.arange(1, _RINGS + 1) / _RINGS:
            for turn in 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS:
                x, z = base[[0, 2]] + distance * np.array([np.cos(turn), np.sin(turn)])
                if self.cut(np.array([x, base[1], z]), radius, height):
                    continue
                y = support(x, z)
                if y is not None and not self.cut(np.array([x, y, z]), radius, height):
                    return np.array([x, y, z])
        return None

    def _pushed(
        self,
        base: Array,
        radius: float,
        height: float,
        support: Callable[[float, float], float | None],
    ) -> Array | None:
        for _ in range(_PUSHES):
            shift = self.push(base, radius, height)
            if np.linalg.norm(shift) <= _TOUCHING * radius:
                return base
            moved = base + shift
            y = support(moved[0], moved[2])
            if y is None:
                # Intersecting a wall is better than falling off a table.
                return base
            base = np.array([moved[0], y, moved[2]])
        return None
