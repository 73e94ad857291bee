"""A furnished living and work room, wholly procedural: its Mitsuba scene and its objects.

World: the scene format's. The floor is at y = -1.5, the capture centre in the room's middle.
The sun comes through the window in the left wall and is not seen from the capture centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from iprt.truth.backend import mitsuba
from iprt.truth.shapes import mitsuba_mesh
from scenes360 import textures
from scenes360.modelling import (
    Solid, box, cushion, cylinder, join, lathe, panel, sheet, sphere, torus_knot, tube,
)

FLOOR, CEILING = -1.5, 1.15
LEFT, RIGHT, FRONT, BACK = -2.5, 2.5, -3.0, 2.6
WINDOW_Z, WINDOW_Y = (-2.45, 0.05), (-0.85, 0.85)
TABLE_TOP = FLOOR + 0.42
SUN = (-0.75, 0.9, -0.35)
SEED = 360

Part = dict[str, Any]


def diffuse(*rgb: float) -> Part:
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(rgb)}}


def textured(image: textures.Image) -> Part:
    return {"type": "diffuse", "reflectance": bitmap(image)}


def glossy(reflectance: Any, alpha: float) -> Part:
    if isinstance(reflectance, tuple):
        reflectance = {"type": "rgb", "value": list(reflectance)}
    return {
        "type": "roughplastic", "distribution": "ggx", "int_ior": 1.5, "alpha": alpha,
        "diffuse_reflectance": reflectance,
    }


def metal(rgb: Sequence[float], alpha: float) -> Part:
    return {
        "type": "roughconductor", "distribution": "ggx", "material": "none", "alpha": alpha,
        "specular_reflectance": {"type": "rgb", "value": list(rgb)},
    }


def bitmap(image: textures.Image) -> Part:
    mi = mitsuba()
    return {"type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(image)), "raw": True}


def both_sides(bsdf: Part) -> Part:
    return {"type": "twosided", "bsdf": bsdf}


WHITE_WALL = (0.76, 0.74, 0.70)
OAK_DARK, OAK_LIGHT = (0.34, 0.20, 0.10), (0.62, 0.42, 0.24)
WALNUT_DARK, WALNUT_LIGHT = (0.085, 0.042, 0.02), (0.20, 0.105, 0.052)
BRASS = (0.80, 0.62, 0.32)


def build() -> dict[str, Any]:
    """All parts of the room, without the inserted objects."""
    pieces: list[tuple[Solid, Part]] = [
        *shell(), *window(), *sofa(), *coffee_table(), *armchair(), *bookshelf(), *desk(),
        *sideboard(), *pictures(), *plant(), *lamp_body(),
    ]
    parts = {f"part{i:03d}": mitsuba_mesh(solid, bsdf) for i, (solid, bsdf) in enumerate(pieces)}
    parts.update(lights())
    return parts


def shell() -> list[tuple[Solid, Part]]:
    wide, deep, high = RIGHT - LEFT, BACK - FRONT, CEILING - FLOOR
    floor = textures.planks((1024, 1024), 32, 2.6, OAK_DARK, OAK_LIGHT, SEED)
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
        panel((LEFT, y0, z0), (out - LEFT, 0, 0), (0, y1 - y0, 0)),
        panel((out, y0, z1), (LEFT - out, 0, 0), (0, y1 - y0, 0)),
    ]
    front = panel((LEFT, FLOOR, FRONT), (wide, 0, 0), (0, high, 0))
    right = panel((RIGHT, FLOOR, FRONT), (0, 0, deep), (0, high, 0))
    back = panel((RIGHT, FLOOR, BACK), (-wide, 0, 0), (0, high, 0))
    ceiling = panel((LEFT, CEILING, FRONT), (wide, 0, 0), (0, 0, deep))
    ground = panel((LEFT, FLOOR, BACK), (wide, 0, 0), (0, 0, -deep))
    skirting = join([
        box((wide, 0.09, 0.015)).at(0, FLOOR + 0.045, FRONT + 0.0075),
        box((wide, 0.09, 0.015)).at(0, FLOOR + 0.045, BACK - 0.0075),
        box((0.015, 0.09, deep)).at(LEFT + 0.0075, FLOOR + 0.045, (FRONT + BACK) / 2),
        box((0.015, 0.09, deep)).at(RIGHT - 0.0075, FLOOR + 0.045, (FRONT + BACK) / 2),
    ])
    carpet = textures.rug((384, 576), (0.50, 0.44, 0.36), (0.11, 0.15, 0.22), (0.34, 0.10, 0.07), SEED)
    # Thick walls outside the panels keep the sky from shining through their seams.
    hull = join([
        box((0.2, high + 1, deep + 1)).at(RIGHT + 0.12, (FLOOR + CEILING) / 2, (FRONT + BACK) / 2),
        box((wide + 1, high + 1, 0.2)).at(0, (FLOOR + CEILING) / 2, FRONT - 0.12),
        box((wide + 1, high + 1, 0.2)).at(0, (FLOOR + CEILING) / 2, BACK + 0.12),
        box((wide + 0.44, 0.2, deep + 1)).at(0, CEILING + 0.12, (FRONT + BACK) / 2),
        box((wide + 0.44, 0.2, deep + 1)).at(0, FLOOR - 0.12, (FRONT + BACK) / 2),
        box((0.2, high + 1, BACK - z1)).at(LEFT - 0.12, (FLOOR + CEILING) / 2, (BACK + z1) / 2 + 0.002),
        box((0.2, high + 1, z0 - FRONT)).at(LEFT - 0.12, (FLOOR + CEILING) / 2, (z0 + FRONT) / 2 - 0.002),
        box((0.2, y0 - FLOOR, z1 - z0)).at(LEFT - 0.12, (FLOOR + y0) / 2 - 0.002, (z0 + z1) / 2),
        box((0.2, CEILING - y1, z1 - z0)).at(LEFT - 0.12, (CEILING + y1) / 2 + 0.002, (z0 + z1) / 2),
    ])
    return [
        (join([right, back, *left]), diffuse(*WHITE_WALL)),
        (front, diffuse(0.30, 0.40, 0.40)),
        (join(reveal), diffuse(0.8, 0.8, 0.78)),
        (ceiling, diffuse(0.82, 0.81, 0.79)),
        (hull, diffuse(0.5, 0.5, 0.5)),
        (ground, glossy(bitmap(floor), 0.25)),
        (skirting, glossy((0.75, 0.74, 0.71), 0.2)),
        (box((2.5, 0.012, 1.7), bevel=0.005).at(0.15, FLOOR + 0.006, -1.35), diffuse(0.42, 0.37, 0.3)),
        (panel((-1.095, FLOOR + 0.0125, -0.505), (2.49, 0, 0), (0, 0, -1.69)), textured(carpet)),
    ]


def window() -> list[tuple[Solid, Part]]:
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
    rod = cylinder(0.014, z1 - z0 + 1.05, bevel=0.004).turned("x", 90).at(LEFT + 0.1, 0.98, z0 - 0.5)
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


def sofa() -> list[tuple[Solid, Part]]:
    x, z, cloth = 0.15, -2.50, textures.fabric((256, 256), (0.13, 0.20, 0.30), SEED + 2)
    frame = [
        box((2.1, 0.20, 0.86), bevel=0.03, steps=4).at(x, FLOOR + 0.22, z),
        box((2.1, 0.50, 0.20), bevel=0.07, steps=6).at(x, FLOOR + 0.55, z - 0.34),
        box((0.20, 0.42, 0.90), bevel=0.07, steps=6).at(x - 1.06, FLOOR + 0.39, z),
        box((0.20, 0.42, 0.90), bevel=0.07, steps=6).at(x + 1.06, FLOOR + 0.39, z),
    ]
    for side in (-0.48, 0.48):
        frame.append(box((0.94, 0.16, 0.70), bevel=0.06, steps=6).at(x + side, FLOOR + 0.38, z + 0.1))
        frame.append(
            box((0.92, 0.42, 0.17), bevel=0.075, steps=6).turned("x", -12).at(x + side, FLOOR + 0.64, z - 0.2)
        )
    legs = [
        cylinder(0.022, 0.13).at(x + sx, FLOOR, z + sz) for sx in (-1.0, 1.0) for sz in (-0.35, 0.35)
    ]
    pillow = cushion(0.46, 0.46, 0.17)
    throw = [
        (pillow.turned("x", 68).turned("y", 14).at(x - 0.74, FLOOR + 0.68, z + 0.0), (0.62, 0.28, 0.07)),
        (pillow.turned("x", 66).turned("y", -6).at(x - 0.42, FLOOR + 0.67, z + 0.05), (0.55, 0.52, 0.46)),
        (pillow.turned("x", 66).turned("y", -16).at(x + 0.74, FLOOR + 0.68, z + 0.0), (0.12, 0.30, 0.24)),
    ]
    return [
        (join(frame), textured(cloth)),
        (join(legs), glossy(WALNUT_LIGHT, 0.2)),
        *((solid, textured(textures.fabric((128, 128), rgb, SEED + i))) for i, (solid, rgb) in enumerate(throw)),
    ]


def coffee_table() -> list[tuple[Solid, Part]]:
    x, z = 0.2, -1.45
    grain = textures.wood((256, 512), WALNUT_DARK, WALNUT_LIGHT, SEED + 5)
    top = box((1.2, 0.045, 0.62), bevel=0.018, steps=5).at(x, TABLE_TOP - 0.0225, z)
    shelf = box((1.0, 0.02, 0.46), bevel=0.008).at(x, FLOOR + 0.16, z)
    legs = [
        tube(
            np.array([[x + sx * 0.50, TABLE_TOP - 0.04, z + sz * 0.23], [x + sx * 0.54, FLOOR, z + sz * 0.26]]),
            np.array([0.024, 0.015]),
        )
        for sx in (-1, 1) for sz in (-1, 1)
    ]
    bowl = lathe(
        [(0, 0), (0.05, 0.0), (0.055, 0.008), (0.10, 0.035), (0.135, 0.075), (0.14, 0.082),
         (0.132, 0.078), (0.095, 0.042), (0.05, 0.016), (0, 0.012)], smooth=6,
    )
    fruit = [
        sphere(0.038).at(-0.035, 0.055, 0.03), sphere(0.036).at(0.045, 0.053, 0.02),
        sphere(0.037).at(0.0, 0.055, -0.045), sphere(0.035).at(0.005, 0.105, 0.0),
    ]
    at = {"x": x - 0.40, "y": TABLE_TOP, "z": z - 0.06}
    magazine = [
        (box((0.21, 0.012, 0.28), bevel=0.003).turned("y", 12).at(x + 0.42, TABLE_TOP + 0.006, z + 0.05), (0.55, 0.12, 0.09)),
        (box((0.19, 0.018, 0.25), bevel=0.003).turned("y", -8).at(x + 0.43, TABLE_TOP + 0.021, z + 0.05), (0.70, 0.66, 0.55)),
    ]
    mug = lathe([(0, 0), (0.036, 0), (0.040, 0.006), (0.041, 0.085), (0.038, 0.088), (0.036, 0.08), (0.034, 0.012), (0, 0.01)])
    handle_t = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 20)
    handle = tube(np.stack([0.038 + 0.028 * np.cos(handle_t), 0.046 + 0.026 * np.sin(handle_t), 0 * handle_t], -1), 0.0055)
    return [
        (top, glossy(bitmap(grain), 0.2)),
        (join([shelf, *legs]), glossy(WALNUT_LIGHT, 0.2)),
        (bowl.at(**at), both_sides(glossy((0.70, 0.70, 0.68), 0.08))),
        (join(fruit[:2]).at(**at), glossy((0.75, 0.30, 0.03), 0.25)),
        (join(fruit[2:]).at(**at), glossy((0.50, 0.55, 0.08), 0.2)),
        *((solid, glossy(rgb, 0.3)) for solid, rgb in magazine),
        (join([mug, handle]).turned("y", 30).at(x + 0.41, TABLE_TOP + 0.03, z + 0.04), both_sides(glossy((0.16, 0.33, 0.38), 0.1))),
    ]


def armchair() -> list[tuple[Solid, Part]]:
    parts = [
        box((0.68, 0.16, 0.66), bevel=0.06, steps=6).at(0, 0.36, 0.02),
        box((0.66, 0.56, 0.15), bevel=0.07, steps=6).turned("x", -14).at(0, 0.66, -0.32),
        box((0.12, 0.26, 0.66), bevel=0.055, steps=6).at(-0.36, 0.46, 0),
        box((0.12, 0.26, 0.66), bevel=0.055, steps=6).at(0.36, 0.46, 0),
    ]
    legs = [
        tube(np.array([[sx * 0.28, 0.30, sz * 0.25], [sx * 0.33, 0.0, sz * 0.31]]), np.array([0.022, 0.013]))
        for sx in (-1, 1) for sz in (-1, 1)
    ]
    place = {"x": 1.72, "y": FLOOR, "z": -1.05}
    return [
        (join(parts).turned("y", -78).at(**place), textured(textures.fabric((256, 256), (0.60, 0.36, 0.10), SEED + 8))),
        (join(legs).turned("y", -78).at(**place), glossy(WALNUT_LIGHT, 0.2)),
    ]


def bookshelf() -> list[tuple[Solid, Part]]:
    z0, z1, depth, height, boards = 0.15, 1.75, 0.30, 1.92, 6
    x = RIGHT - depth / 2
    grain = textures.wood((256, 512), OAK_DARK, OAK_LIGHT, SEED + 9)
    carcass = [box((depth, 0.024, z1 - z0)).at(x, FLOOR + 0.06 + k * (height - 0.08) / (boards - 1), (z0 + z1) / 2) for k in range(boards)]
    carcass += [box((depth, height, 0.024)).at(x, FLOOR + height / 2, z) for z in (z0, (z0 + z1) / 2, z1)]
    carcass.append(box((0.012, height, z1 - z0)).at(RIGHT - 0.008, FLOOR + height / 2, (z0 + z1) / 2))
    rng = np.random.default_rng(SEED)
    palette = np.array([
        (0.45, 0.08, 0.06), (0.06, 0.14, 0.28), (0.62, 0.55, 0.40), (0.08, 0.22, 0.14), (0.70, 0.40, 0.08),
        (0.20, 0.07, 0.14), (0.72, 0.70, 0.66), (0.10, 0.10, 0.11), (0.16, 0.36, 0.42),
    ])
    books: list[list[Solid]] = [[] for _ in palette]
    gap = (height - 0.08) / (boards - 1)
    for row in range(boards - 1):
        base = FLOOR + 0.06 + row * gap + 0.012
        for half in range(2):
            start = z0 + 0.02 + half * (z1 - z0) / 2
            stop = start + (z1 - z0) / 2 - 0.045
            stop -= rng.choice([0.0, 0.12, 0.3])
            z = start
            while True:
                thick, tall, deep = rng.uniform(0.016, 0.05), gap * rng.uniform(0.58, 0.86), rng.uniform(0.16, 0.23)
                if z + thick > stop:
                    break
                lean = 0.0 if rng.random() < 0.93 else 7.0
                book = box((deep, tall, thick), bevel=0.004).turned("x", lean)
                books[rng.integers(len(palette))].append(book.at(RIGHT - 0.05 - deep / 2, base + tall / 2, z + thick / 2))
                z += thick + 0.0015 + 0.0006 * lean * 5
    jar = lathe([(0, 0), (0.06, 0.0), (0.085, 0.06), (0.075, 0.13), (0.035, 0.17), (0.045, 0.2)], smooth=8)
    ball = sphere(0.075)
    return [
        (join(carcass), glossy(bitmap(grain), 0.3)),
        *((join(group), glossy(tuple(rgb), 0.35)) for group, rgb in zip(books, palette, strict=True) if group),
        (jar.at(x - 0.02, FLOOR + height - 0.005, z0 + 0.3), both_sides(glossy((0.08, 0.24, 0.34), 0.06))),
        (ball.at(x - 0.02, FLOOR + height + 0.068, z1 - 0.35), metal(BRASS, 0.25)),
    ]


def desk() -> list[tuple[Solid, Part]]:
    x, z, top = -0.45, BACK - 0.36, FLOOR + 0.74
    grain = textures.wood((256, 512), OAK_DARK, OAK_LIGHT, SEED + 12)
    plate = box((1.5, 0.035, 0.68), bevel=0.008).at(x, top - 0.0175, z)
    legs = [box((0.05, 0.705, 0.05)).at(x + sx * 0.68, FLOOR + 0.3525, z + sz * 0.28) for sx in (-1, 1) for sz in (-1, 1)]
    drawer = box((0.42, 0.5, 0.58), bevel=0.006).at(x - 0.48, FLOOR + 0.44, z)
    screen = [
        box((0.62, 0.37, 0.025), bevel=0.008).at(x + 0.05, top + 0.34, z + 0.12),
        box((0.05, 0.2, 0.03)).at(x + 0.05, top + 0.1, z + 0.14),
        box((0.24, 0.012, 0.18)).at(x + 0.05, top + 0.006, z + 0.12),
        box((0.42, 0.018, 0.14), bevel=0.006).at(x + 0.05, top + 0.009, z - 0.18),
    ]
    seat = [
        box((0.44, 0.05, 0.42), bevel=0.02, steps=4).at(0, 0.46, 0),
        box((0.42, 0.34, 0.03), bevel=0.014, steps=3).turned("x", 8).at(0, 0.76, -0.2),
    ]
    frame = [tube(np.array([[sx * 0.17, 0.45, sz * 0.16], [sx * 0.21, 0.0, sz * 0.2]]), 0.013) for sx in (-1, 1) for sz in (-1, 1)]
    frame += [tube(np.array([[sx * 0.14, 0.45, -0.17], [sx * 0.14, 0.85, -0.225]]), 0.011) for sx in (-1, 1)]
    chair = {"x": x + 0.1, "y": FLOOR, "z": z - 0.62}
    papers = [box((0.21, 0.006, 0.297), bevel=0.001).turned("y", a).at(x - 0.45, top + 0.003 + 0.006 * k, z - 0.1) for k, a in enumerate((4, -9, 15))]
    cup = lathe([(0, 0), (0.038, 0), (0.04, 0.005), (0.04, 0.1), (0.036, 0.1), (0.036, 0.012), (0, 0.01)]).at(x + 0.55, top, z + 0.1)
    pens = [tube(np.array([[x + 0.55, top + 0.01, z + 0.1], [x + 0.55 + dx, top + 0.17, z + 0.1 + dz]]), 0.004) for dx, dz in ((0.03, 0.01), (-0.02, 0.025), (0.01, -0.03))]
    arm = [
        cylinder(0.09, 0.02), tube(np.array([[0, 0.02, 0], [0.08, 0.32, 0.02], [-0.12, 0.52, 0]]), 0.009),
        lathe([(0.025, 0.06), (0.04, 0.05), (0.085, -0.04)], smooth=6).turned("z", -28).at(-0.14, 0.5, 0),
    ]
    return [
        (join([plate, *legs]), glossy(bitmap(grain), 0.25)),
        (drawer, glossy((0.72, 0.71, 0.68), 0.2)),
        (join(screen), glossy((0.03, 0.03, 0.035), 0.12)),
        (join(seat).turned("y", 180 - 20).at(**chair), glossy((0.10, 0.22, 0.20), 0.3)),
        (join(frame).turned("y", 180 - 20).at(**chair), metal((0.55, 0.55, 0.57), 0.2)),
        (join(papers), diffuse(0.75, 0.74, 0.70)),
        (cup, both_sides(glossy((0.55, 0.16, 0.10), 0.1))),
        (join(pens), glossy((0.10, 0.14, 0.4), 0.2)),
        (join(arm).at(x + 0.52, top, z + 0.02), both_sides(metal(BRASS, 0.15))),
    ]


def sideboard() -> list[tuple[Solid, Part]]:
    z, depth, width, height = 1.25, 0.40, 1.3, 0.62
    x = LEFT + depth / 2 + 0.02
    grain = textures.wood((256, 512), WALNUT_DARK, WALNUT_LIGHT, SEED + 15)
    body = [box((depth, height - 0.14, width), bevel=0.008).at(x, FLOOR + 0.14 + (height - 0.14) / 2, z)]
    doors = [box((0.016, height - 0.19, width / 3 - 0.02), bevel=0.004).at(x + depth / 2 + 0.006, FLOOR + 0.14 + (height - 0.14) / 2, z + k * (width / 3 - 0.004)) for k in (-1, 0, 1)]
    legs = [tube(np.array([[x + sx * 0.14, FLOOR + 0.14, z + sz * 0.55], [x + sx * 0.16, FLOOR, z + sz * 0.58]]), np.array([0.02, 0.012])) for sx in (-1, 1) for sz in (-1, 1)]
    knobs = [sphere(0.012, segments=16).at(x + depth / 2 + 0.02, FLOOR + 0.42, z + k * (width / 3 - 0.004) + 0.14) for k in (-1, 0, 1)]
    tall = lathe([(0, 0), (0.05, 0), (0.06, 0.01), (0.09, 0.10), (0.07, 0.22), (0.03, 0.30), (0.04, 0.34)], smooth=8)
    low = lathe([(0, 0), (0.05, 0.0), (0.09, 0.04), (0.095, 0.08), (0.06, 0.12), (0.05, 0.125)], smooth=8)
    top = FLOOR + height
    stack = [box((0.2, 0.03, 0.27), bevel=0.004).turned("y", a).at(x, top + 0.015 + 0.03 * k, z + 0.1) for k, a in enumerate((3, -6, 9))]
    return [
        (join([*body, *doors]), glossy(bitmap(grain), 0.2)),
        (join(legs), glossy(WALNUT_LIGHT, 0.2)),
        (join(knobs), metal(BRASS, 0.15)),
        (tall.at(x, top, z - 0.42), both_sides(glossy((0.66, 0.62, 0.55), 0.35))),
        (low.at(x + 0.03, top, z - 0.2), both_sides(glossy((0.20, 0.09, 0.05), 0.12))),
        (stack[0], glossy((0.08, 0.2, 0.26), 0.3)), (stack[1], glossy((0.6, 0.5, 0.32), 0.3)),
        (stack[2], glossy((0.42, 0.08, 0.06), 0.3)),
    ]


def pictures() -> list[tuple[Solid, Part]]:
    sunset = [(0.55, 0.30, 0.22), (0.80, 0.62, 0.38), (0.90, 0.80, 0.55), (0.30, 0.32, 0.38), (0.16, 0.24, 0.28), (0.07, 0.13, 0.14)]
    sea = [(0.75, 0.72, 0.64), (0.36, 0.48, 0.52), (0.10, 0.24, 0.34), (0.05, 0.10, 0.18), (0.62, 0.52, 0.36)]
    warm = [(0.78, 0.74, 0.66), (0.62, 0.22, 0.10), (0.10, 0.18, 0.26), (0.78, 0.52, 0.16), (0.26, 0.36, 0.30)]
    hung = [  # centre, turn, width, height, picture
        ((-0.72, 0.12, FRONT), 0, 0.52, 0.70, textures.hills((280, 208), sunset, SEED)),
        ((0.15, 0.12, FRONT), 0, 0.80, 0.70, textures.bands((280, 320), sea, SEED + 1)),
        ((1.02, 0.12, FRONT), 0, 0.52, 0.70, textures.discs((280, 208), warm, SEED + 2)),
        ((LEFT, 0.10, 1.25), 90, 0.9, 0.6, textures.hills((240, 360), sea[:1] + warm[:1] + sunset[2:], SEED + 3)),
        ((-0.45, 0.30, BACK), 180, 0.9, 0.5, textures.discs((200, 360), sea[:1] + sunset[1:], SEED + 7)),
        ((RIGHT, 0.10, -0.9), -90, 0.5, 0.7, textures.bands((280, 200), warm, SEED + 5)),
    ]
    pieces: list[tuple[Solid, Part]] = []
    for (x, y, z), turn, w, h, image in hung:
        frame = join([
            box((w + 0.04, 0.025, 0.03)).at(0, h / 2 + 0.008, 0.015), box((w + 0.04, 0.025, 0.03)).at(0, -h / 2 - 0.008, 0.015),
            box((0.025, h + 0.02, 0.03)).at(w / 2 + 0.008, 0, 0.015), box((0.025, h + 0.02, 0.03)).at(-w / 2 - 0.008, 0, 0.015),
        ])
        canvas = panel((-w / 2, -h / 2, 0.012), (w, 0, 0), (0, h, 0))
        pieces.append((frame.turned("y", turn).at(x, y, z), glossy(WALNUT_DARK, 0.2)))
        pieces.append((canvas.turned("y", turn).at(x, y, z), textured(image[::-1])))
    return pieces


def plant() -> list[tuple[Solid, Part]]:
    rng = np.random.default_rng(SEED + 20)
    leaves, stems = [], []
    for k in range(26):
        turn, rise = k * 137.5, 1.0 - 0.75 * k / 26
        length, reach = rng.uniform(0.34, 0.5), rng.uniform(0.25, 0.42) * (1.15 - 0.5 * rise)
        s = np.linspace(0, 1, 12)
        stem = np.stack([reach * s**1.3, (0.28 + 0.62 * rise) * s, 0 * s], -1)
        t, u = np.meshgrid(np.linspace(0, 1, 18), np.linspace(-1, 1, 9), indexing="ij")
        width = 0.075 * np.sin(np.pi * np.clip(t, 0, 1) ** 0.75) ** 0.8
        start = stem[-1]
        blade = np.stack([
            start[0] + length * (0.85 * t - 0.1 * t**2), start[1] + length * (0.55 * t - 0.95 * t**2) + 0.03 * u**2 * width / 0.075,
            width * u * 1.0,
        ], -1)
        leaves.append(sheet(blade).turned("y", turn))
        stems.append(tube(stem, np.linspace(0.009, 0.004, 12), segments=8).turned("y", turn))
    pot = lathe([(0, 0), (0.13, 0), (0.14, 0.01), (0.185, 0.30), (0.19, 0.32), (0.175, 0.32), (0.165, 0.27), (0, 0.27)])
    spot = {"x": -2.02, "y": FLOOR, "z": -2.55}
    green = join(leaves).at(0, 0.27, 0).at(**spot)
    return [
        (green, both_sides(glossy((0.07, 0.22, 0.06), 0.3))),
        (join(stems).at(0, 0.27, 0).at(**spot), glossy((0.12, 0.22, 0.06), 0.3)),
        (pot.at(**spot), both_sides(glossy((0.58, 0.55, 0.50), 0.3))),
    ]


LAMP = (2.02, FLOOR, -2.52)


def lamp_body() -> list[tuple[Solid, Part]]:
    pole = join([cylinder(0.15, 0.025), cylinder(0.012, 1.52).at(0, 0.02, 0)])
    return [(pole.at(*LAMP), metal(BRASS, 0.15))]


def lights() -> dict[str, Any]:
    mi = mitsuba()
    outside = textures.sky(1024, sun=SUN, sun_radiance=(38000.0, 34500.0, 29000.0), sun_radius_deg=0.8, seed=SEED)
    shade = lathe([(0.20, 1.38), (0.15, 1.66)], segments=96)
    light = {"type": "area", "radiance": {"type": "rgb", "value": [5.5, 3.6, 1.8]}}
    inside = lathe([(0.148, 1.66), (0.198, 1.38)], segments=96)
    glow = {"type": "area", "radiance": {"type": "rgb", "value": [9.0, 6.0, 3.0]}}
    return {
        # Mitsuba's environment has the direction -z at its edges, the scene format in its middle.
        "outside": {"type": "envmap", "bitmap": mi.Bitmap(np.roll(outside, 512, axis=1))},
        "shade": mitsuba_mesh(shade.at(*LAMP), diffuse(0.6, 0.55, 0.45), light),
        "shade_inside": mitsuba_mesh(inside.at(*LAMP), diffuse(0.6, 0.55, 0.45), glow),
    }


def objects() -> dict[str, Solid]:
    """The meshes of the inserted objects, standing on y = 0 around the origin."""
    vase = lathe(
        [(0, 0), (0.045, 0), (0.055, 0.006), (0.085, 0.07), (0.09, 0.12), (0.06, 0.20), (0.035, 0.25), (0.034, 0.28),
         (0.05, 0.31), (0.046, 0.312), (0.03, 0.28), (0.03, 0.25), (0.054, 0.20), (0.082, 0.12), (0.078, 0.07), (0.045, 0.015), (0, 0.012)],
        smooth=5, segments=72,
    )
    body = lathe(
        [(0, 0), (0.06, 0), (0.068, 0.006), (0.10, 0.05), (0.108, 0.09), (0.085, 0.135), (0.05, 0.152), (0.046, 0.158), (0.03, 0.172),
         (0.012, 0.178), (0.010, 0.186), (0.019, 0.196), (0.016, 0.208), (0, 0.212)], smooth=5, segments=72,
    )
    t = np.linspace(0, 1, 28)
    spout = tube(np.stack([0.085 + 0.10 * t, 0.06 + 0.03 * t + 0.06 * t**2, 0 * t], -1), 0.026 - 0.013 * t, segments=20)
    a = np.linspace(-0.62 * np.pi, 0.62 * np.pi, 36)
    handle = tube(np.stack([-0.10 - 0.058 * np.cos(a), 0.092 + 0.052 * np.sin(a), 0 * a], -1), 0.009, segments=14)
    knot = torus_knot(2, 3, 0.16, 0.042)
    knot = knot.turned("x", 90)
    return {
        "vase": vase,
        "pot": join([body, spout, handle]),
        "knot": knot.at(0, -float(knot.positions[:, 1].min()), 0),
        "ball": sphere(0.17, segments=72).at(0, 0.17, 0),
    }
