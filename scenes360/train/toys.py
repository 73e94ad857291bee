"""Toy train and its track as Mitsuba parts: the real object that moves in the clip."""

from __future__ import annotations

import numpy as np

from scenes360 import textures
from scenes360.materials import bitmap, diffuse, glossy, metal
from scenes360.modelling import Solid, box, cylinder, join, lathe, sphere
from scenes360.room.plan import BRASS, FLOOR, LEFT, OAK_DARK, OAK_LIGHT, RIGHT, RUG, SEED, Pieces
from scenes360.train.plan import RAIL_TOP, TRACK_Z, WHEEL, train_x

GREEN, RED, BLACK = (0.05, 0.24, 0.12), (0.55, 0.06, 0.04), (0.035, 0.035, 0.04)
BLUE, YELLOW, CREAM = (0.05, 0.14, 0.40), (0.75, 0.48, 0.06), (0.70, 0.62, 0.46)
GAUGE = 0.085
"""Half of the distance between the rails."""
COUPLING = 0.56
"""Distance between the middles of the locomotive and of its wagon."""


def track() -> Pieces:
    """Return two rails on sleepers across the room, level over floor and rug."""
    length = RIGHT - LEFT - 0.3
    foot, top = FLOOR, RUG + 0.024
    sleepers = [
        box((0.06, top - foot, 0.30), bevel=0.004).at(x, (foot + top) / 2, TRACK_Z)
        for x in np.arange(LEFT + 0.25, RIGHT - 0.2, 0.16)
    ]
    rails = [
        box((length, RAIL_TOP - top, 0.018), bevel=0.003).at(0, (top + RAIL_TOP) / 2, TRACK_Z + dz)
        for dz in (-GAUGE, GAUGE)
    ]
    grain = textures.wood((64, 128), OAK_DARK, OAK_LIGHT, SEED + 31)
    return [
        (join(sleepers), glossy(bitmap(grain), 0.4)),
        (join(rails), metal((0.6, 0.6, 0.62), 0.3)),
    ]


def train(time_s: float) -> Pieces:
    """Return the locomotive and its wagon at a time."""
    x = train_x(time_s)
    turn_deg = -np.rad2deg(x / WHEEL)
    place = {"y": RAIL_TOP, "z": TRACK_Z}
    loco = [(solid.at(x, **place), bsdf) for solid, bsdf in _locomotive(turn_deg)]
    return loco + [(solid.at(x - COUPLING, **place), bsdf) for solid, bsdf in _wagon(turn_deg)]


def _along_x(solid: Solid) -> Solid:
    return solid.turned("z", -90)


def _wheels(places: tuple[float, ...], turn_deg: float) -> tuple[list[Solid], list[Solid]]:
    """Return wheels, and bosses on them that make their rotation visible."""
    angle = np.deg2rad(turn_deg)
    boss_x, boss_y = 0.6 * WHEEL * np.cos(angle), 0.6 * WHEEL * np.sin(angle)
    wheels, bosses = [], []
    for x in places:
        for z in (-GAUGE, GAUGE):
            disc = cylinder(WHEEL, 0.024).at(0, -0.012, 0).turned("x", 90)
            wheels.append(disc.at(x, WHEEL, z))
            bosses.append(sphere(0.016, segments=16).at(x + boss_x, WHEEL + boss_y, 1.15 * z))
    return wheels, bosses


def _locomotive(turn_deg: float) -> Pieces:
    wheels, bosses = _wheels((-0.16, 0.0, 0.16), turn_deg)
    frame = [
        box((0.52, 0.045, 0.17), bevel=0.008).at(0, 0.10, 0),
        box((0.02, 0.06, 0.22), bevel=0.006).at(0.265, 0.09, 0),
        box((0.05, 0.012, 0.02)).at(-0.28, 0.09, 0),
    ]
    boiler = _along_x(cylinder(0.088, 0.32, bevel=0.008)).at(-0.07, 0.215, 0)
    bands = [_along_x(cylinder(0.091, 0.014)).at(x, 0.215, 0) for x in (-0.02, 0.09, 0.2)]
    dome = sphere(0.042).at(0.04, 0.30, 0)
    chimney = lathe([(0.028, 0.0), (0.026, 0.07), (0.046, 0.13), (0.046, 0.14), (0, 0.14)])
    lamp = sphere(0.026).at(0.262, 0.225, 0)
    cab = box((0.17, 0.25, 0.19), bevel=0.012, steps=4).at(-0.165, 0.245, 0)
    roof = box((0.22, 0.022, 0.23), bevel=0.010, steps=4).at(-0.165, 0.38, 0)
    panes = [
        box((0.10, 0.09, 0.196), bevel=0.004).at(-0.165, 0.30, 0),
        box((0.176, 0.09, 0.13), bevel=0.004).at(-0.165, 0.30, 0),
    ]
    return [
        (boiler, glossy(GREEN, 0.12)),
        (join([*bands, dome]), metal(BRASS, 0.15)),
        (join([*frame, chimney.at(0.17, 0.29, 0)]), glossy(BLACK, 0.25)),
        (cab, glossy(RED, 0.15)),
        (join([roof, *panes]), glossy(BLACK, 0.2)),
        (join(wheels), glossy(RED, 0.2)),
        (join([*bosses, lamp]), glossy(CREAM, 0.2)),
    ]


def _wagon(turn_deg: float) -> Pieces:
    wheels, bosses = _wheels((-0.12, 0.12), turn_deg)
    body = [
        box((0.42, 0.04, 0.18), bevel=0.008).at(0, 0.11, 0),
        box((0.42, 0.09, 0.014), bevel=0.004).at(0, 0.17, 0.086),
        box((0.42, 0.09, 0.014), bevel=0.004).at(0, 0.17, -0.086),
        box((0.014, 0.09, 0.17), bevel=0.004).at(0.203, 0.17, 0),
        box((0.014, 0.09, 0.17), bevel=0.004).at(-0.203, 0.17, 0),
    ]
    cube = box((0.10, 0.10, 0.10), bevel=0.008, steps=3)
    load = [
        (cube.turned("y", 12).at(-0.12, 0.20, 0.0), YELLOW),
        (cube.turned("y", -20).at(0.02, 0.20, 0.01), RED),
        (cube.turned("y", 33).at(-0.05, 0.30, 0.0), CREAM),
    ]
    return [
        (join(body), glossy(BLUE, 0.2)),
        (join(wheels), glossy(YELLOW, 0.2)),
        (join(bosses), glossy(CREAM, 0.2)),
        *((solid, diffuse(*rgb)) for solid, rgb in load),
        (sphere(0.055).at(0.135, 0.195, 0.0), glossy(GREEN, 0.1)),
    ]
