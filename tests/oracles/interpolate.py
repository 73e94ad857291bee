"""Slow numpy twin of the interpolation of sparse signals (IPRT, Algorithm 2, joint bilateral)."""

from __future__ import annotations

import numpy as np

from tests.oracles.guide import Array, falloff
from tests.oracles.mask import traced


def interpolate(
    signal: Array,
    level: Array,
    normal: Array,
    position: Array,
    ids: Array,
    offset: tuple[int, int],
    sharpness: tuple[float, float],
    equirect: bool,
) -> Array:
    """(C, H, W) dense signal; `sharpness` of the falloff with normals and plane distance."""
    height, width = level.shape
    has_ray = traced(level, offset)

    def pixel(x: int, y: int) -> tuple[int, int] | None:
        x = x % width if equirect else x
        return (y, x) if 0 <= x < width and 0 <= y < height else None

    def ray(x: int, y: int) -> tuple[int, int] | None:
        at = pixel(x, y)
        return at if at is not None and has_ray[at] else None

    def corners(x: int, y: int, spacing: int) -> list[tuple[int, int]]:
        left = x - (x - offset[0]) % spacing
        top = y - (y - offset[1]) % spacing
        return [(left + i * spacing, top + j * spacing) for j in (0, 1) for i in (0, 1)]

    result = signal.copy()
    for y, x in np.argwhere(~has_ray):
        result[:, y, x] = 0.0
        if level[y, x] == 255:
            continue
        spacing = {1: 2, 2: 4, 3: 2}[int(level[y, x])]
        for cx, cy in corners(x, y, spacing):
            at = pixel(cx, cy)
            if at is not None and level[at] == 2 and not has_ray[at]:
                spacing = 4
        weights, total = 0.0, np.zeros(len(signal))
        for cx, cy in corners(x, y, spacing):
            at = ray(cx, cy)
            if at is None or ids[at] != ids[y, x]:
                continue
            turn = max(1.0 - normal[:, *at] @ normal[:, y, x], 0.0)
            off = abs(normal[:, y, x] @ (position[:, *at] - position[:, y, x]))
            far = sharpness[0] * turn + sharpness[1] * off / np.linalg.norm(position[:, y, x])
            weight = (spacing - abs(cx - x)) * (spacing - abs(cy - y)) * falloff(np.float64(far))
            weights += weight
            total += weight * signal[:, *at]
        if weights < 1e-3:
            near = [
                (ids[at] != ids[y, x], dx * dx + dy * dy, dy, dx, at)
                for dy in range(-3, 4)
                for dx in range(-3, 4)
                if (at := ray(x + dx, y + dy)) is not None
            ]
            weights, total = (1.0, signal[:, *min(near)[-1]]) if near else (1.0, 0.0 * total)
        result[:, y, x] = total / weights
    return result
