"""Rooms in which a ball or the camera moves, and a floor of which it is known how it reflects.

What walls, window and ball send is given; what the floor sends is summed up from it: its shading
by all that it sees, less what the ball hides, and the reflection of a rough coat.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.footage.coated_rooms import WINDOW, reflections, sky, towards_window
from tests.oracles.worlds import Sphere, World, frame_of
from tests.worlds import Float, pose_at

SHADING_RAYS, COAT_RAYS = 384, 48
WALLS = 0.6


def seen(
    alpha: float | None,
    contrast: float,
    ball: tuple[float, float] | None = None,
    *,
    glow: float = 4.0,
    camera: tuple[float, float, float] = (0.0, 0.0, 0.0),
    yaw_deg: float = 0.0,
    rows: int = 128,
) -> Frame:
    """What a camera sees of a floor with a coat of that roughness, or without one.

    Parameters
    ----------
    contrast : float
        Of the floor's texture: standard deviation of its reflectance over the mean.
    ball : (x, z) or None
        Where a ball of radius 0.25 m stands.
    glow : float
        The radiance that it sends.
    """
    world = World()
    if ball is not None:
        x, z = ball
        world = World(solids=(Sphere((x, world.low[1] + 0.25, z), 0.25),))
    pose = pose_at(camera, yaw_deg)
    d = View(2 * rows, rows, projection="equirect").directions() @ pose[:3, :3].T
    t, normal, which = world.first_hit(pose[:3, 3], d)
    points = pose[:3, 3] + t[..., None] * d
    color = _sent(points, d, normal, which, glow)
    floor = (normal[..., 1] > 0.5) & (which == 0)
    x = points[floor]
    albedo = 0.3 * _shade(x, contrast)[:, None] * (1.0, 0.8, 0.6)
    color[floor] = albedo / np.pi * _irradiance(world, x, glow)
    if alpha is not None:
        color[floor] += _coat(world, x, -d[floor], glow, alpha)
    frame = frame_of(t, normal @ pose[:3, :3], _in_window(points, normal) & (which == 0))
    moved = None if camera == (0.0, 0.0, 0.0) and yaw_deg == 0.0 else pose
    return replace(frame, color=color.astype(np.float32), pose=moved)


def _shade(x: Float, contrast: float) -> Float:
    """Tiles of another reflectance each, and grain across them."""
    tile = np.floor(x[:, 0] / 0.17) * 12.9898 + np.floor(x[:, 2] / 0.23) * 78.233
    even = np.modf(np.abs(np.sin(tile) * 43758.5453))[0]
    grain = 0.25 * np.sin(60.0 * x[:, 0] + 3.0 * tile)
    return np.asarray(np.exp(contrast * (3.3 * (even - 0.5) + grain)))


def _in_window(points: Float, normal: Float) -> Float:
    (x0, y0), (x1, y1) = WINDOW.low, WINDOW.high
    x, y = points[..., 0], points[..., 1]
    return np.asarray((normal[..., 2] > 0.5) & (x > x0) & (x < x1) & (y > y0) & (y < y1))


def _sent(points: Float, d: Float, normal: Float, which: Float, glow: float) -> Float:
    """Radiance of all but the floor, which sends none here."""
    walls = WALLS * (1.0 + 0.3 * np.sin(1.3 * points).sum(-1, keepdims=True) / 3.0)
    color = np.where((which > 0)[..., None], glow, walls * (1.0, 0.95, 0.9))
    color = np.where((_in_window(points, normal) & (which == 0))[..., None], sky(d), color)
    return np.where(((normal[..., 1] > 0.5) & (which == 0))[..., None], 0.0, color)


def _irradiance(world: World, x: Float, glow: float) -> Float:
    """(n, 3) at points of the floor: through the window point by point, the rest by rays."""
    total = np.zeros((len(x), 3))
    for way, factor in towards_window(x):
        _, _, which = world.first_hit(x + 1e-6 * way, way)
        total += sky(way) * ((which == 0) * factor)[:, None]
    rng = np.random.default_rng(5)
    side = int(np.sqrt(SHADING_RAYS))
    for ray in range(side * side):
        u, v = (ray // side + rng.random(len(x))) / side, (ray % side + rng.random(len(x))) / side
        sine, azimuth = np.sqrt(u), 2.0 * np.pi * v
        way = np.stack([sine * np.cos(azimuth), np.sqrt(1.0 - u), sine * np.sin(azimuth)], -1)
        total += np.pi / side**2 * _met(world, x, way, glow, window=False)
    return total


def _met(world: World, x: Float, way: Float, glow: float, *, window: bool) -> Float:
    t, normal, which = world.first_hit(x + 1e-6 * way, way)
    end = x + t[:, None] * way
    through = _in_window(end, normal) & (which == 0) & (not window)
    return np.where(through[:, None], 0.0, _sent(end, way, normal, which, glow))


def _coat(world: World, x: Float, out: Float, glow: float, alpha: float) -> Float:
    """(n, 3) what the coat reflects, by the distribution of its normals."""
    rng = np.random.default_rng(3)
    material = Material("plastic", alpha=alpha, ior=1.5)
    total = np.zeros((len(x), 3))
    for ray in range(COAT_RAYS):
        u, azimuth = (ray + rng.random(len(x))) / COAT_RAYS, 2.0 * np.pi * rng.random(len(x))
        good, way, weight = reflections(out, material, u, azimuth)
        total[good] += weight * _met(world, x[good], way, glow, window=True)
    return total / COAT_RAYS
