"""Rooms with a window whose light is known, and floors of which it is known how they reflect it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_texel
from iprt.geometry.material import Material
from tests.frame.radiosity import ROOM, Window, room
from tests.oracles.brdf import evaluate_specular, ggx
from tests.worlds import Float

RAYS, WINDOW_POINTS = 32, 16


def sky(directions: Float) -> Float:
    """Bright, bluish, and brighter upwards; the ground is dim."""
    up = directions[..., 1:2]
    return np.where(up > -0.1, 12.0 + 6.0 * up, 2.0) * (0.8, 1.0, 1.2)


WINDOW = Window((-0.9, -0.5), (0.7, 0.9), sky)


def boards(points: Float, normals: Float) -> Float:
    """Grey walls; boards on the floor whose reflectance differs by 30%, and a grain along them."""
    board = np.floor(points[..., 0] / 0.14) * 7.0 + np.floor(points[..., 2] / 0.9) * 3.0
    shade = 0.25 * (1.0 + 0.3 * np.sin(board**2) + 0.15 * np.sin(90.0 * points[..., 0] + board))
    floor = (normals[..., 1] > 0.5)[..., None]
    return np.where(floor, shade[..., None] * (1.0, 0.7, 0.5), 0.5)


def plain(points: Float, normals: Float) -> Float:
    return np.broadcast_to(0.5, points.shape)


@cache
def matte_room(textured: bool = True, rows: int = 128) -> Frame:
    """As seen from its capture centre."""
    return room(boards if textured else plain, window=WINDOW, rows=rows)


@cache
def coated_room(alpha: float, textured: bool = True, rows: int = 128) -> Frame:
    """The same with a rough coat on the floor.

    Of its reflection, the window's part is summed up over the window, and that of the walls found
    by directions drawn by the distribution of normals, which meet the walls where these truly are.
    """
    frame = matte_room(textured, rows)
    d = View(2 * rows, rows, projection="equirect").directions()
    floor = (frame.normal[..., 1] > 0.5) & ~frame.opening
    points = d[floor] * frame.depth[floor][:, None]
    material = Material("plastic", alpha=alpha, ior=1.5)
    out = -d[floor]
    shine = _of_window(points, out, material) + _of_walls(frame, points, out, material)
    color = frame.color.astype(np.float64)
    color[floor] += shine
    return replace(frame, color=color.astype(np.float32))


def _local(directions: Float) -> Float:
    """With +z up; a mirror image, which no isotropic lobe shows."""
    return np.asarray(directions[..., [0, 2, 1]])


def towards_window(points: Float) -> Iterator[tuple[Float, Float]]:
    """Directions (n, 3) from points of the floor to parts of the window, and form factors (n,)."""
    (x0, y0), (x1, y1) = WINDOW.low, WINDOW.high
    area = (x1 - x0) * (y1 - y0) / WINDOW_POINTS**2
    across = (np.arange(WINDOW_POINTS) + 0.5) / WINDOW_POINTS
    for x in x0 + across * (x1 - x0):
        for y in y0 + across * (y1 - y0):
            way = np.array([x, y, ROOM.low[2]]) - points
            squared = (way**2).sum(-1)
            way /= np.sqrt(squared)[:, None]
            yield way, way[:, 1] * -way[:, 2] * area / squared


def reflections(
    out: Float, material: Material, u: Float, azimuth: Float
) -> tuple[NDArray[np.bool_], Float, Float]:
    """Rays that the coat of the floor reflects, by the distribution of its normals.

    Returns which of n directions (n, 3) have one, its direction (m, 3) and its weight (m, 1).
    """
    alpha, local = material.alpha, _local(out)
    cosine = np.sqrt((1.0 - u) / (1.0 + (alpha**2 - 1.0) * u))
    sine = np.sqrt(1.0 - cosine**2)
    h = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=-1)
    across = (local * h).sum(-1)
    way = 2.0 * across[:, None] * h - local
    good = (across > 1e-3) & (way[:, 2] > 1e-3)
    density = ggx(h[good], alpha) * h[good][:, 2] / (4.0 * across[good])
    weight = evaluate_specular(material, local[good], way[good])
    return good, _local(way[good]), weight * (way[good][:, 2] / density)[:, None]


def _of_window(points: Float, out: Float, material: Material) -> Float:
    total = np.zeros((len(points), 3))
    for way, factor in towards_window(points):
        f = evaluate_specular(material, _local(out), _local(way))
        total += f * sky(way) * factor[:, None]
    return total


def _of_walls(frame: Frame, points: Float, out: Float, material: Material) -> Float:
    rng = np.random.default_rng(3)
    total = np.zeros((len(points), 3))
    for _ in range(RAYS):
        u, azimuth = rng.random(len(out)), 2.0 * np.pi * rng.random(len(out))
        good, ray, weight = reflections(out, material, u, azimuth)
        start = points[good]
        t, _, _ = ROOM.first_hit(start, ray)
        where = equirect_texel(start + t[:, None] * ray, frame.width, frame.height)
        through = frame.opening[where]
        total[good] += weight * np.where(through[:, None], 0.0, frame.color[where])
    return total / RAYS
