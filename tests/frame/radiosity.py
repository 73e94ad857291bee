"""Closed rooms whose light is known: diffuse walls, lamps in the ceiling, a window on the distance.

Walls are cut into squares that exchange light until it settles; lamps and windows are summed up
point by point. Nothing is hidden in an empty room.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from tests.oracles.worlds import World
from tests.worlds import Float

ROOM = World()
SQUARES = 12
"""A side, of each wall."""
BOUNCES = 40
POINTS = 16
"""A side, of lamps and windows."""

Albedo = Callable[[Float, Float], Float]
"""Reflectance (..., 3) at points (..., 3) with normals (..., 3)."""


@dataclass(frozen=True)
class Lamp:
    """A square of the ceiling: centre (x, z) in metres, half its side, and its radiance."""

    x: float
    z: float
    half: float
    radiance: tuple[float, float, float]


@dataclass(frozen=True)
class Window:
    """A rectangle of the wall ahead, x and y from `low` to `high`; `sky` of directions (..., 3)."""

    low: tuple[float, float]
    high: tuple[float, float]
    sky: Callable[[Float], Float]


def room(
    albedo: Albedo, lamps: Sequence[Lamp] = (), window: Window | None = None, rows: int = 128
) -> Frame:
    """Build the panorama that the capture centre sees."""
    points, normals, area = _squares()
    direct = _direct(points, normals, lamps, window)
    reflectance = albedo(points, normals)
    way = points[None] - points[:, None]
    squared = (way**2).sum(-1) + np.eye(len(points))
    leaving = np.maximum((way * normals[:, None]).sum(-1), 0.0)
    arriving = np.maximum(-(way * normals[None]).sum(-1), 0.0)
    factor = leaving * arriving / squared**2 * area
    # Those of a closed room sum up to pi; squares that touch are too near for one point each.
    factor *= np.pi / factor.sum(1, keepdims=True)
    radiance = np.zeros_like(direct)
    for _ in range(BOUNCES):
        radiance = reflectance / np.pi * (direct + factor @ radiance)

    d = View(2 * rows, rows, projection="equirect").directions()
    depth, normal, _ = ROOM.first_hit(np.zeros(3), d)
    x, n = (depth[..., None] * d).reshape(-1, 3), normal.reshape(-1, 3)
    indirect = _gathered(x, n, points, normals, area, radiance)
    color = albedo(x, n) / np.pi * (_direct(x, n, lamps, window) + indirect)
    for lamp in lamps:
        color[_in_lamp(x, n, lamp)] = lamp.radiance
    opening = np.zeros(len(x), bool)
    if window is not None:
        inside = (x[:, :2] > window.low) & (x[:, :2] < window.high)
        opening = inside.all(-1) & (n[:, 2] > 0.5)
        color[opening] = window.sky(d.reshape(-1, 3)[opening])
    frame = ROOM.frame(2 * rows, rows)
    return replace(
        frame,
        color=color.reshape(*depth.shape, 3).astype(np.float32),
        opening=opening.reshape(depth.shape),
    )


def _squares() -> tuple[Float, Float, Float]:
    """Centres, normals into the room, and areas."""
    low, high = np.array(ROOM.low), np.array(ROOM.high)
    at = (np.arange(SQUARES) + 0.5) / SQUARES
    points, normals, areas = [], [], []
    for axis in range(3):
        first, second = (a for a in range(3) if a != axis)
        for wall, side in ((low, 1.0), (high, -1.0)):
            point = np.empty((SQUARES, SQUARES, 3))
            point[..., axis] = wall[axis]
            point[..., first] = (low[first] + at * (high - low)[first])[:, None]
            point[..., second] = low[second] + at * (high - low)[second]
            points.append(point.reshape(-1, 3))
            normals.append(np.tile(side * (np.arange(3) == axis), (SQUARES**2, 1)))
            areas.append(
                np.full(SQUARES**2, (high - low)[first] * (high - low)[second] / SQUARES**2)
            )
    return np.concatenate(points), np.concatenate(normals), np.concatenate(areas)


def _in_lamp(x: Float, n: Float, lamp: Lamp) -> Float:
    beside = np.maximum(np.abs(x[:, 0] - lamp.x), np.abs(x[:, 2] - lamp.z))
    return np.asarray((beside < lamp.half) & (n[:, 1] < -0.5))


def _direct(x: Float, n: Float, lamps: Sequence[Lamp], window: Window | None) -> Float:
    """Irradiance (n, 3) by lamps and window."""
    total = np.zeros((len(x), 3))
    across = 2.0 * (np.arange(POINTS) + 0.5) / POINTS - 1.0
    for lamp in lamps:
        for a in across:
            for b in across:
                y = np.array([lamp.x + a * lamp.half, ROOM.high[1], lamp.z + b * lamp.half])
                part = _point(x, n, y, np.array([0.0, -1.0, 0.0]))
                total += part[:, None] * lamp.radiance * (2.0 * lamp.half / POINTS) ** 2
    if window is not None:
        size = (np.array(window.high) - window.low) / 2.0
        for a in across:
            for b in across:
                at = np.array(window.low) + size * (1.0 + np.array([a, b]))
                y = np.array([*at, ROOM.low[2]])
                way = y - x
                way /= np.linalg.norm(way, axis=-1, keepdims=True)
                part = _point(x, n, y, np.array([0.0, 0.0, 1.0]))
                total += part[:, None] * window.sky(way) * (4.0 * size.prod() / POINTS**2)
    return total


def _point(x: Float, n: Float, y: Float, m: Float) -> Float:
    """Irradiance (n,) by a unit of area and radiance at y that looks along m."""
    way = y - x
    squared = np.maximum((way**2).sum(-1), 1e-4)
    return np.maximum((way * n).sum(-1), 0.0) * np.maximum(-way @ m, 0.0) / squared**2


def _gathered(x: Float, n: Float, y: Float, m: Float, area: Float, radiance: Float) -> Float:
    """Irradiance (n, 3) by the squares: their mean radiance, weighted by form factors, times π."""
    total, weight = np.zeros((len(x), 3)), np.zeros(len(x))
    for start in range(0, len(y), 64):
        part = slice(start, start + 64)
        way = y[part] - x[:, None]
        squared = (way**2).sum(-1)
        leaving = np.maximum((way * n[:, None]).sum(-1), 0.0)
        arriving = np.maximum(-(way * m[part]).sum(-1), 0.0)
        factor = leaving * arriving * area[part] / np.maximum(squared, 0.01) ** 2
        total += factor @ radiance[part]
        weight += factor.sum(1)
    return np.asarray(np.pi * total / weight[:, None])
