"""Furniture along the walls: bookshelf, desk, sideboard, plant."""

from __future__ import annotations

import numpy as np

from scenes360 import textures
from scenes360.materials import bitmap, both_sides, diffuse, glossy, metal
from scenes360.modelling import Solid, box, cylinder, join, lathe, sheet, sphere, tube
from scenes360.room.plan import (
    BACK,
    BRASS,
    FLOOR,
    LEFT,
    OAK_DARK,
    OAK_LIGHT,
    RIGHT,
    SEED,
    WALNUT_DARK,
    WALNUT_LIGHT,
    Pieces,
)


def bookshelf(detail: int = 1) -> Pieces:
    """Return the bookshelf."""
    z0, z1, depth, height, boards = 0.15, 1.75, 0.30, 1.92, 6
    x = RIGHT - depth / 2
    grain = textures.wood((256 * detail, 512 * detail), OAK_DARK, OAK_LIGHT, SEED + 9)
    carcass = [
        box((depth, 0.024, z1 - z0)).at(
            x, FLOOR + 0.06 + k * (height - 0.08) / (boards - 1), (z0 + z1) / 2
        )
        for k in range(boards)
    ]
    carcass += [
        box((depth, height, 0.024)).at(x, FLOOR + height / 2, z) for z in (z0, (z0 + z1) / 2, z1)
    ]
    carcass.append(
        box((0.012, height, z1 - z0)).at(RIGHT - 0.008, FLOOR + height / 2, (z0 + z1) / 2)
    )
    rng = np.random.default_rng(SEED)
    palette = np.array(
        [
            (0.45, 0.08, 0.06),
            (0.06, 0.14, 0.28),
            (0.62, 0.55, 0.40),
            (0.08, 0.22, 0.14),
            (0.70, 0.40, 0.08),
            (0.20, 0.07, 0.14),
            (0.72, 0.70, 0.66),
            (0.10, 0.10, 0.11),
            (0.16, 0.36, 0.42),
        ]
    )
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
                thick, tall, deep = (
                    rng.uniform(0.016, 0.05),
                    gap * rng.uniform(0.58, 0.86),
                    rng.uniform(0.16, 0.23),
                )
                if z + thick > stop:
                    break
                lean = 0.0 if rng.random() < 0.93 else 7.0
                book = box((deep, tall, thick), bevel=0.004).turned("x", lean)
                books[rng.integers(len(palette))].append(
                    book.at(RIGHT - 0.05 - deep / 2, base + tall / 2, z + thick / 2)
                )
                z += thick + 0.0015 + 0.0006 * lean * 5
    jar = lathe(
        [(0, 0), (0.06, 0.0), (0.085, 0.06), (0.075, 0.13), (0.035, 0.17), (0.045, 0.2)], smooth=8
    )
    ball = sphere(0.075)
    return [
        (join(carcass), glossy(bitmap(grain), 0.3)),
        *(
            (join(group), glossy(tuple(rgb), 0.35))
            for group, rgb in zip(books, palette, strict=True)
            if group
        ),
        (
            jar.at(x - 0.02, FLOOR + height - 0.005, z0 + 0.3),
            both_sides(glossy((0.08, 0.24, 0.34), 0.06)),
        ),
        (ball.at(x - 0.02, FLOOR + height + 0.068, z1 - 0.35), metal(BRASS, 0.25)),
    ]


def desk(detail: int = 1) -> Pieces:
    """Return the desk."""
    x, z, top = -0.45, BACK - 0.36, FLOOR + 0.74
    grain = textures.wood((256 * detail, 512 * detail), OAK_DARK, OAK_LIGHT, SEED + 12)
    plate = box((1.5, 0.035, 0.68), bevel=0.008).at(x, top - 0.0175, z)
    legs = [
        box((0.05, 0.705, 0.05)).at(x + sx * 0.68, FLOOR + 0.3525, z + sz * 0.28)
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
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
    frame = [
        tube(np.array([[sx * 0.17, 0.45, sz * 0.16], [sx * 0.21, 0.0, sz * 0.2]]), 0.013)
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
    frame += [
        tube(np.array([[sx * 0.14, 0.45, -0.17], [sx * 0.14, 0.85, -0.225]]), 0.011)
        for sx in (-1, 1)
    ]
    chair = {"x": x + 0.1, "y": FLOOR, "z": z - 0.62}
    papers = [
        box((0.21, 0.006, 0.297), bevel=0.001)
        .turned("y", a)
        .at(x - 0.45, top + 0.003 + 0.006 * k, z - 0.1)
        for k, a in enumerate((4, -9, 15))
    ]
    cup = lathe(
        [(0, 0), (0.038, 0), (0.04, 0.005), (0.04, 0.1), (0.036, 0.1), (0.036, 0.012), (0, 0.01)]
    ).at(x + 0.55, top, z + 0.1)
    pens = [
        tube(
            np.array([[x + 0.55, top + 0.01, z + 0.1], [x + 0.55 + dx, top + 0.17, z + 0.1 + dz]]),
            0.004,
        )
        for dx, dz in ((0.03, 0.01), (-0.02, 0.025), (0.01, -0.03))
    ]
    arm = [
        cylinder(0.09, 0.02),
        tube(np.array([[0, 0.02, 0], [0.08, 0.32, 0.02], [-0.12, 0.52, 0]]), 0.009),
        lathe([(0.025, 0.06), (0.04, 0.05), (0.085, -0.04)], smooth=6)
        .turned("z", -28)
        .at(-0.14, 0.5, 0),
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


def sideboard(detail: int = 1) -> Pieces:
    """Return the sideboard."""
    z, depth, width, height = 1.25, 0.40, 1.3, 0.62
    x = LEFT + depth / 2 + 0.02
    grain = textures.wood((256 * detail, 512 * detail), WALNUT_DARK, WALNUT_LIGHT, SEED + 15)
    body = [
        box((depth, height - 0.14, width), bevel=0.008).at(x, FLOOR + 0.14 + (height - 0.14) / 2, z)
    ]
    doors = [
        box((0.016, height - 0.19, width / 3 - 0.02), bevel=0.004).at(
            x + depth / 2 + 0.006, FLOOR + 0.14 + (height - 0.14) / 2, z + k * (width / 3 - 0.004)
        )
        for k in (-1, 0, 1)
    ]
    legs = [
        tube(
            np.array(
                [
                    [x + sx * 0.14, FLOOR + 0.14, z + sz * 0.55],
                    [x + sx * 0.16, FLOOR, z + sz * 0.58],
                ]
            ),
            np.array([0.02, 0.012]),
        )
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
    knobs = [
        sphere(0.012, segments=16).at(
            x + depth / 2 + 0.02, FLOOR + 0.42, z + k * (width / 3 - 0.004) + 0.14
        )
        for k in (-1, 0, 1)
    ]
    tall = lathe(
        [(0, 0), (0.05, 0), (0.06, 0.01), (0.09, 0.10), (0.07, 0.22), (0.03, 0.30), (0.04, 0.34)],
        smooth=8,
    )
    low = lathe(
        [(0, 0), (0.05, 0.0), (0.09, 0.04), (0.095, 0.08), (0.06, 0.12), (0.05, 0.125)], smooth=8
    )
    top = FLOOR + height
    stack = [
        box((0.2, 0.03, 0.27), bevel=0.004).turned("y", a).at(x, top + 0.015 + 0.03 * k, z + 0.1)
        for k, a in enumerate((3, -6, 9))
    ]
    return [
        (join([*body, *doors]), glossy(bitmap(grain), 0.2)),
        (join(legs), glossy(WALNUT_LIGHT, 0.2)),
        (join(knobs), metal(BRASS, 0.15)),
        (tall.at(x, top, z - 0.42), both_sides(glossy((0.66, 0.62, 0.55), 0.35))),
        (low.at(x + 0.03, top, z - 0.2), both_sides(glossy((0.20, 0.09, 0.05), 0.12))),
        (stack[0], glossy((0.08, 0.2, 0.26), 0.3)),
        (stack[1], glossy((0.6, 0.5, 0.32), 0.3)),
        (stack[2], glossy((0.42, 0.08, 0.06), 0.3)),
    ]


def plant() -> Pieces:
    """Return the plant."""
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
        blade = np.stack(
            [
                start[0] + length * (0.85 * t - 0.1 * t**2),
                start[1] + length * (0.55 * t - 0.95 * t**2) + 0.03 * u**2 * width / 0.075,
                width * u * 1.0,
            ],
            -1,
        )
        leaves.append(sheet(blade).turned("y", turn))
        stems.append(tube(stem, np.linspace(0.009, 0.004, 12), segments=8).turned("y", turn))
    pot = lathe(
        [
            (0, 0),
            (0.13, 0),
            (0.14, 0.01),
            (0.185, 0.30),
            (0.19, 0.32),
            (0.175, 0.32),
            (0.165, 0.27),
            (0, 0.27),
        ]
    )
    spot = {"x": -2.02, "y": FLOOR, "z": -2.55}
    green = join(leaves).at(0, 0.27, 0).at(**spot)
    return [
        (green, both_sides(glossy((0.07, 0.22, 0.06), 0.3))),
        (join(stems).at(0, 0.27, 0).at(**spot), glossy((0.12, 0.22, 0.06), 0.3)),
        (pot.at(**spot), both_sides(glossy((0.58, 0.55, 0.50), 0.3))),
    ]
