"""Front of the room: sofa, coffee table, armchair, floor lamp."""

from __future__ import annotations

import numpy as np

from scenes360 import textures
from scenes360.materials import bitmap, both_sides, glossy, metal, textured
from scenes360.modelling import box, cushion, cylinder, join, lathe, sphere, tube
from scenes360.room.plan import (
    BRASS,
    FLOOR,
    LAMP,
    SEED,
    TABLE_ALPHA,
    TABLE_TOP,
    TEAK_DARK,
    TEAK_LIGHT,
    WALNUT_LIGHT,
    Pieces,
)


def sofa(detail: int = 1) -> Pieces:
    """Return the sofa."""
    x, z, cloth = (
        0.15,
        -2.50,
        textures.fabric((256 * detail, 256 * detail), (0.13, 0.20, 0.30), SEED + 2),
    )
    frame = [
        box((2.1, 0.20, 0.86), bevel=0.03, steps=4).at(x, FLOOR + 0.22, z),
        box((2.1, 0.50, 0.20), bevel=0.07, steps=6).at(x, FLOOR + 0.55, z - 0.34),
        box((0.20, 0.42, 0.90), bevel=0.07, steps=6).at(x - 1.06, FLOOR + 0.39, z),
        box((0.20, 0.42, 0.90), bevel=0.07, steps=6).at(x + 1.06, FLOOR + 0.39, z),
    ]
    for side in (-0.48, 0.48):
        frame.append(
            box((0.94, 0.16, 0.70), bevel=0.06, steps=6).at(x + side, FLOOR + 0.38, z + 0.1)
        )
        frame.append(
            box((0.92, 0.42, 0.17), bevel=0.075, steps=6)
            .turned("x", -12)
            .at(x + side, FLOOR + 0.64, z - 0.2)
        )
    legs = [
        cylinder(0.022, 0.13).at(x + sx, FLOOR, z + sz)
        for sx in (-1.0, 1.0)
        for sz in (-0.35, 0.35)
    ]
    pillow = cushion(0.46, 0.46, 0.17)
    throw = [
        (
            pillow.turned("x", 68).turned("y", 14).at(x - 0.74, FLOOR + 0.68, z + 0.0),
            (0.62, 0.28, 0.07),
        ),
        (
            pillow.turned("x", 66).turned("y", -6).at(x - 0.42, FLOOR + 0.67, z + 0.05),
            (0.55, 0.52, 0.46),
        ),
        (
            pillow.turned("x", 66).turned("y", -16).at(x + 0.74, FLOOR + 0.68, z + 0.0),
            (0.12, 0.30, 0.24),
        ),
    ]
    return [
        (join(frame), textured(cloth)),
        (join(legs), glossy(WALNUT_LIGHT, 0.2)),
        *(
            (solid, textured(textures.fabric((128 * detail, 128 * detail), rgb, SEED + i)))
            for i, (solid, rgb) in enumerate(throw)
        ),
    ]


def coffee_table(detail: int = 1) -> Pieces:
    """Return the coffee table."""
    x, z = 0.2, -1.45
    grain = textures.wood((256 * detail, 512 * detail), TEAK_DARK, TEAK_LIGHT, SEED + 5)
    top = box((1.2, 0.045, 0.62), bevel=0.018, steps=5).at(x, TABLE_TOP - 0.0225, z)
    shelf = box((1.0, 0.02, 0.46), bevel=0.008).at(x, FLOOR + 0.16, z)
    legs = [
        tube(
            np.array(
                [
                    [x + sx * 0.50, TABLE_TOP - 0.04, z + sz * 0.23],
                    [x + sx * 0.54, FLOOR, z + sz * 0.26],
                ]
            ),
            np.array([0.024, 0.015]),
        )
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
    bowl = lathe(
        [
            (0, 0),
            (0.05, 0.0),
            (0.055, 0.008),
            (0.10, 0.035),
            (0.135, 0.075),
            (0.14, 0.082),
            (0.132, 0.078),
            (0.095, 0.042),
            (0.05, 0.016),
            (0, 0.012),
        ],
        smooth=6,
    )
    fruit = [
        sphere(0.038).at(-0.035, 0.055, 0.03),
        sphere(0.036).at(0.045, 0.053, 0.02),
        sphere(0.037).at(0.0, 0.055, -0.045),
        sphere(0.035).at(0.005, 0.105, 0.0),
    ]
    at = {"x": x - 0.40, "y": TABLE_TOP, "z": z - 0.06}
    magazine = [
        (
            box((0.21, 0.012, 0.28), bevel=0.003)
            .turned("y", 12)
            .at(x + 0.42, TABLE_TOP + 0.006, z + 0.05),
            (0.55, 0.12, 0.09),
        ),
        (
            box((0.19, 0.018, 0.25), bevel=0.003)
            .turned("y", -8)
            .at(x + 0.43, TABLE_TOP + 0.021, z + 0.05),
            (0.70, 0.66, 0.55),
        ),
    ]
    mug = lathe(
        [
            (0, 0),
            (0.036, 0),
            (0.040, 0.006),
            (0.041, 0.085),
            (0.038, 0.088),
            (0.036, 0.08),
            (0.034, 0.012),
            (0, 0.01),
        ]
    )
    handle_t = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 20)
    handle = tube(
        np.stack(
            [0.038 + 0.028 * np.cos(handle_t), 0.046 + 0.026 * np.sin(handle_t), 0 * handle_t], -1
        ),
        0.0055,
    )
    return [
        (top, glossy(bitmap(grain), TABLE_ALPHA)),
        (join([shelf, *legs]), glossy(TEAK_LIGHT, 0.2)),
        (bowl.at(**at), both_sides(glossy((0.70, 0.70, 0.68), 0.08))),
        (join(fruit[:2]).at(**at), glossy((0.75, 0.30, 0.03), 0.25)),
        (join(fruit[2:]).at(**at), glossy((0.50, 0.55, 0.08), 0.2)),
        *((solid, glossy(rgb, 0.3)) for solid, rgb in magazine),
        (
            join([mug, handle]).turned("y", 30).at(x + 0.41, TABLE_TOP + 0.03, z + 0.04),
            both_sides(glossy((0.16, 0.33, 0.38), 0.1)),
        ),
    ]


def armchair(detail: int = 1) -> Pieces:
    """Return the armchair."""
    parts = [
        box((0.68, 0.16, 0.66), bevel=0.06, steps=6).at(0, 0.36, 0.02),
        box((0.66, 0.56, 0.15), bevel=0.07, steps=6).turned("x", -14).at(0, 0.66, -0.32),
        box((0.12, 0.26, 0.66), bevel=0.055, steps=6).at(-0.36, 0.46, 0),
        box((0.12, 0.26, 0.66), bevel=0.055, steps=6).at(0.36, 0.46, 0),
    ]
    legs = [
        tube(
            np.array([[sx * 0.28, 0.30, sz * 0.25], [sx * 0.33, 0.0, sz * 0.31]]),
            np.array([0.022, 0.013]),
        )
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
    place = {"x": 1.72, "y": FLOOR, "z": -1.05}
    return [
        (
            join(parts).turned("y", -78).at(**place),
            textured(textures.fabric((256 * detail, 256 * detail), (0.60, 0.36, 0.10), SEED + 8)),
        ),
        (join(legs).turned("y", -78).at(**place), glossy(WALNUT_LIGHT, 0.2)),
    ]


def lamp_body() -> Pieces:
    """Return the floor lamp without its light."""
    pole = join([cylinder(0.15, 0.025), cylinder(0.012, 1.52).at(0, 0.02, 0)])
    return [(pole.at(*LAMP), metal(BRASS, 0.15))]
