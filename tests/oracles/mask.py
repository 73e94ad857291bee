"""Slow numpy twin of the sparse tracing mask (IPRT, Eqs. 3 and 4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tests.oracles.guide import Array, shifted


def tracing_weight(
    normal: Array,
    position: Array,
    ids: Array,
    touched: Array,
    sigma: float,
    equirect: bool,
    faint: float = 0.0,
) -> Array:
    """(H, W) weight w of Eq. 3 from (3, H, W) normal and position, (H, W) ids and touched.

    Touched counts where it is more than `faint`.
    """
    weight = np.zeros(ids.shape)
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            other = shifted(ids, dx, dy, equirect, fill=-1.0)
            inside = other >= 0.0
            turn = np.linalg.norm(shifted(normal, dx, dy, equirect) - normal, axis=0)
            apart = np.linalg.norm(shifted(position, dx, dy, equirect) - position, axis=0)
            difference = np.where(other == ids, np.maximum(turn, sigma * apart), 1.0)
            active = (max(abs(dx), abs(dy)) <= 1) & (shifted(touched, dx, dy, equirect) > faint)
            weight = np.maximum(weight, np.where(inside, difference, 0.0))
            weight = np.maximum(weight, np.where(inside & active, 1.0, 0.0))
    return np.minimum(weight, 1.0)


def levels(weight: Array, ids: Array, low: float, high: float, touched: NDArray[np.bool_]) -> Array:
    """(H, W) tracing level of Eq. 4, 255 where there is nothing to trace.

    `touched` pixels and their neighbours take one ray for four at least.
    """
    chosen = np.where(weight >= high, 0, np.where((weight >= low) | touched, 1, 2))
    return np.asarray(np.where(ids > 0.0, chosen, 255))


def waiting(level: Array, history: Array, offset: tuple[int, int]) -> Array:
    """The levels, 3 in place of 0 where the history is worth so many samples that a pixel waits
    until the tracing grid of spacing 2 comes by.
    """
    y, x = np.mgrid[: level.shape[0], : level.shape[1]]
    on_grid = ((x - offset[0]) % 2 == 0) & ((y - offset[1]) % 2 == 0)
    return np.where((level == 0) & (history > 7.5) & ~on_grid, 3, level)


def near(touched: Array, equirect: bool) -> NDArray[np.bool_]:
    """(H, W) bool, pixels of which one of 3x3 is touched."""
    found = np.zeros(touched.shape, bool)
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            found |= shifted(touched, dx, dy, equirect) > 0.0
    return found


def traced(level: Array, offset: tuple[int, int]) -> Array:
    """(H, W) bool, the pixels that get a ray."""
    y, x = np.mgrid[: level.shape[0], : level.shape[1]]
    spacing = np.where(level == 255, 1, 2 ** np.minimum(level, 2))
    on_grid = ((x - offset[0]) % spacing == 0) & ((y - offset[1]) % spacing == 0)
    return np.asarray(on_grid & (level < 3))
