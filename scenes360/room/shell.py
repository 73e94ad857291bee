"""Walls, floor, window, pictures, and lights."""

from __future__ import annotations

from typing import Any

import numpy as np

from iprt.truth.backend import mitsuba
from iprt.truth.shapes import mitsuba_mesh
from scenes360 import textures
from scenes360.materials import bitmap, both_sides, diffuse, glossy, metal, textured
from scenes360.modelling import box, cylinder, join, lathe, panel, sheet
from scenes360.room.plan import (
    BACK,
    BRASS,
    CEILING,
    FLOOR,
    FLOOR_ALPHA,
    FRONT,
    LAMP,
    LEFT,
    OAK_DARK,
    OAK_LIGHT,
    RIGHT,
    RUG,
    SEED,
    SUN,
    WALNUT_DARK,
    WHITE_WALL,
    WINDOW_Y,
    WINDOW_Z,
    Pieces,
)


def shell(floor_alpha: float = FLOOR_ALPHA, detail: int = 1) -> Pieces:
    """Return walls, ceiling, rug, and a floor of this roughness."""
    wide, deep, high = RIGHT - LEFT, BACK - FRONT, CEILING - FLOOR
    floor = textures.planks((1024 * detail, 1024 * detail), 32, 2.6, OAK_DARK, OAK_LIGHT, SEED)
    (z0, z1), (y0, y1) = WINDOW_Z, WINDOW_Y
    left = [  # around the window; seen from inside, +z is to the left
        panel((LEFT, FLOOR, BACK), (0, 0, z1 - BACK), (0, high, 0)),
        panel((LEFT, FLOOR, z0), (0, 0, FRONT - z0), (0, high, 0)),
        panel((LEFT, FLOOR, z1), (0, 0, z0 - z1), (0, y0 - FLOOR, 0)),
        panel((LEFT, y1, z1), (0, 0, z0 - z1), (0, CEILING - y1, 0)),
    ]
    out = LEFT - 0.22  # reveal: the wall's thickness
    reveal = [
        panel((out, y0, z1), (-out + LEFT, 0, 0), (0, 0, z0 - z1)),
        panel((out, y1, z0), (-out + LEFT, 0, 0), (0, 0, z1 - z0)),
        panel((out, y0, z0), (LEFT - out, 0, 0), (0, y1 - y0, 0)),
        panel((LEFT, y0, z1), (out - LEFT, 0, 0), (0, y1 - y0, 0)),
    ]
    front = panel((LEFT, FLOOR, FRONT), (wide, 0, 0), (0, high, 0))
    right = panel((RIGHT, FLOOR, FRONT), (0, 0, deep), (0, high, 0))
    back = panel((RIGHT, FLOOR, BACK), (-wide, 0, 0), (0, high, 0))
    ceiling = panel((LEFT, CEILING, FRONT), (wide, 0, 0), (0, 0, deep))
    ground = panel((LEFT, FLOOR, BACK), (wide, 0, 0), (0, 0, -deep))
    skirting = join(
        [
            box((wide, 0.09, 0.015)).at(0, FLOOR + 0.045, FRONT + 0.0075),
            box((wide, 0.09, 0.015)).at(0, FLOOR + 0.045, BACK - 0.0075),
            box((0.015, 0.09, deep)).at(LEFT + 0.0075, FLOOR + 0.045, (FRONT + BACK) / 2),
            box((0.015, 0.09, deep)).at(RIGHT - 0.0075, FLOOR + 0.045, (FRONT + BACK) / 2),
        ]
    )
    carpet = textures.rug(
        (384 * detail, 576 * detail),
        (0.50, 0.44, 0.36),
        (0.11, 0.15, 0.22),
        (0.34, 0.10, 0.07),
        SEED,
    )
    # Thick walls outside the panels keep the sky from shining through their seams.
    hull = join(
        [
            box((0.2, high + 1, deep + 1)).at(
                RIGHT + 0.12, (FLOOR + CEILING) / 2, (FRONT + BACK) / 2
            ),
            box((wide + 1, high + 1, 0.2)).at(0, (FLOOR + CEILING) / 2, FRONT - 0.12),
            box((wide + 1, high + 1, 0.2)).at(0, (FLOOR + CEILING) / 2, BACK + 0.12),
            box((wide + 0.44, 0.2, deep + 1)).at(0, CEILING + 0.12, (FRONT + BACK) / 2),
            box((wide + 0.44, 0.2, deep + 1)).at(0, FLOOR - 0.12, (FRONT + BACK) / 2),
            box((0.2, high + 1, BACK - z1)).at(
                LEFT - 0.12, (FLOOR + CEILING) / 2, (BACK + z1) / 2 + 0.002
            ),
            box((0.2, high + 1, z0 - FRONT)).at(
                LEFT - 0.12, (FLOOR + CEILING) / 2, (z0 + FRONT) / 2 - 0.002
            ),
            box((0.2, y0 - FLOOR, z1 - z0)).at(
                LEFT - 0.12, (FLOOR + y0) / 2 - 0.002, (z0 + z1) / 2
            ),
            box((0.2, CEILING - y1, z1 - z0)).at(
                LEFT - 0.12, (CEILING + y1) / 2 + 0.002, (z0 + z1) / 2
            ),
        ]
    )
    return [
        (join([right, back, *left]), diffuse(*WHITE_WALL)),
        (front, diffuse(0.30, 0.40, 0.40)),
        (join(reveal), diffuse(0.8, 0.8, 0.78)),
        (ceiling, diffuse(0.72, 0.71, 0.69)),
        (hull, diffuse(0.5, 0.5, 0.5)),
        (ground, glossy(bitmap(floor), floor_alpha)),
        (skirting, glossy((0.75, 0.74, 0.71), 0.2)),
        (
            box((2.5, 0.012, 1.7), bevel=0.005).at(0.15, FLOOR + 0.006, -1.35),
            diffuse(0.42, 0.37, 0.3),
        ),
        (panel((-1.095, RUG, -0.505), (2.49, 0, 0), (0, 0, -1.69)), textured(carpet)),
    ]


def window() -> Pieces:
    """Return the window."""
    (z0, z1), (y0, y1) = WINDOW_Z, WINDOW_Y
    x, mid_z, mid_y = LEFT - 0.12, (z0 + z1) / 2, (y0 + y1) / 2
    bars = [
        box((0.06, 0.06, z1 - z0)).at(x, y0 + 0.03, mid_z),
        box((0.06, 0.06, z1 - z0)).at(x, y1 - 0.03, mid_z),
        box((0.06, y1 - y0, 0.06)).at(x, mid_y, z0 + 0.03),
        box((0.06, y1 - y0, 0.06)).at(x, mid_y, z1 - 0.03),
        box((0.05, y1 - y0, 0.07)).at(x, mid_y, mid_z),
        box((0.04, 0.03, z1 - z0)).at(x, y0 + 0.62 * (y1 - y0), mid_z),
        box((0.34, 0.03, z1 - z0 + 0.12)).at(LEFT - 0.03, y0 - 0.012, mid_z),
    ]
    rod = (
        cylinder(0.014, z1 - z0 + 1.05, bevel=0.004).turned("x", 90).at(LEFT + 0.1, 0.98, z0 - 0.5)
    )
    drapes = []
    for centre, width, phase in ((z0 - 0.20, 0.50, 0.0), (z1 + 0.24, 0.56, 1.3)):
        v, u = np.meshgrid(np.linspace(0, 1, 24), np.linspace(0, 1, 120), indexing="ij")
        fold = 0.045 * np.sin(2 * np.pi * 6.5 * u + phase + 0.6 * np.sin(3 * v)) * (0.55 + 0.45 * v)
        fold = fold + 0.012 * np.sin(2 * np.pi * 2.3 * u + 4 * v)
        grid = np.stack(
            [LEFT + 0.11 + fold, 0.96 - v * 2.42, centre + width * (0.5 - u) * (0.9 + 0.1 * v)], -1
        )
        drapes.append(sheet(grid))
    return [
        (join(bars), glossy((0.80, 0.79, 0.76), 0.15)),
        (rod, metal(BRASS, 0.2)),
        (join(drapes), both_sides(diffuse(0.62, 0.55, 0.45))),
    ]


def pictures(detail: int = 1) -> Pieces:
    """Return the framed pictures on the walls."""
    sunset = [
        (0.55, 0.30, 0.22),
        (0.80, 0.62, 0.38),
        (0.90, 0.80, 0.55),
        (0.30, 0.32, 0.38),
        (0.16, 0.24, 0.28),
        (0.07, 0.13, 0.14),
    ]
    sea = [
        (0.75, 0.72, 0.64),
        (0.36, 0.48, 0.52),
        (0.10, 0.24, 0.34),
        (0.05, 0.10, 0.18),
        (0.62, 0.52, 0.36),
    ]
    warm = [
        (0.78, 0.74, 0.66),
        (0.62, 0.22, 0.10),
        (0.10, 0.18, 0.26),
        (0.78, 0.52, 0.16),
        (0.26, 0.36, 0.30),
    ]
    hung = [  # centre, turn, width, height, picture
        (
            (-0.72, 0.12, FRONT),
            0,
            0.52,
            0.70,
            textures.hills((280 * detail, 208 * detail), sunset, SEED),
        ),
        (
            (0.15, 0.12, FRONT),
            0,
            0.80,
            0.70,
            textures.bands((280 * detail, 320 * detail), sea, SEED + 1),
        ),
        (
            (1.02, 0.12, FRONT),
            0,
            0.52,
            0.70,
            textures.discs((280 * detail, 208 * detail), warm, SEED + 2),
        ),
        (
            (LEFT, 0.10, 1.25),
            90,
            0.9,
            0.6,
            textures.hills((240 * detail, 360 * detail), sea[:1] + warm[:1] + sunset[2:], SEED + 3),
        ),
        (
            (-0.45, 0.30, BACK),
            180,
            0.9,
            0.5,
            textures.discs((200 * detail, 360 * detail), sea[:1] + sunset[1:], SEED + 7),
        ),
        (
            (RIGHT, 0.10, -0.9),
            -90,
            0.5,
            0.7,
            textures.bands((280 * detail, 200 * detail), warm, SEED + 5),
        ),
    ]
    pieces: Pieces = []
    for (x, y, z), turn, w, h, image in hung:
        frame = join(
            [
                box((w + 0.04, 0.025, 0.03)).at(0, h / 2 + 0.008, 0.015),
                box((w + 0.04, 0.025, 0.03)).at(0, -h / 2 - 0.008, 0.015),
                box((0.025, h + 0.02, 0.03)).at(w / 2 + 0.008, 0, 0.015),
                box((0.025, h + 0.02, 0.03)).at(-w / 2 - 0.008, 0, 0.015),
            ]
        )
        canvas = panel((-w / 2, -h / 2, 0.012), (w, 0, 0), (0, h, 0))
        pieces.append((frame.turned("y", turn).at(x, y, z), glossy(WALNUT_DARK, 0.2)))
        pieces.append((canvas.turned("y", turn).at(x, y, z), textured(image[::-1])))
    return pieces


def lights() -> dict[str, Any]:
    """Return the lamps and the environment outside."""
    mi = mitsuba()
    outside = textures.sky(
        1024, sun=SUN, sun_radiance=(30000.0, 27200.0, 23000.0), sun_radius_deg=0.8, seed=SEED
    )
    shade = lathe([(0.20, 1.38), (0.15, 1.66)], segments=96)
    light = {"type": "area", "radiance": {"type": "rgb", "value": [11.0, 7.6, 4.2]}}
    inside = lathe([(0.148, 1.66), (0.198, 1.38)], segments=96)
    glow = {"type": "area", "radiance": {"type": "rgb", "value": [16.0, 11.0, 6.1]}}
    return {
        # Mitsuba's environment has the direction -z at its edges, the scene format in its middle.
        "outside": {"type": "envmap", "bitmap": mi.Bitmap(np.roll(outside, 512, axis=1))},
        "shade": mitsuba_mesh(shade.at(*LAMP), diffuse(0.6, 0.55, 0.45), light),
        "shade_inside": mitsuba_mesh(inside.at(*LAMP), diffuse(0.6, 0.55, 0.45), glow),
    }
