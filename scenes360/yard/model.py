"""Paved yard under open sky, wholly procedural, as Mitsuba parts.

World: the scene format's. The ground is at y = -1.5.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from iprt.truth.backend import mitsuba
from iprt.truth.shapes import mitsuba_mesh
from scenes360 import textures
from scenes360.materials import both_sides, diffuse, glossy, textured
from scenes360.modelling import box, cylinder, join, lathe, panel, sheet, sphere, tube
from scenes360.room.plan import TEAK_DARK, TEAK_LIGHT, Pieces

GROUND = -1.5
SEED = 71
SUN = (-0.75, 0.55, -0.3)
"""Direction towards the sun: behind the house, as seen from the capture centre."""
IRRADIANCE = (26.0, 23.5, 19.0)
"""Of a surface perpendicular to the sun."""


def ground() -> Pieces:
    """Return paving stones, and the lawn around them."""
    stones = textures.planks((768, 768), 12, 9.0, (0.34, 0.32, 0.29), (0.50, 0.47, 0.42), SEED)
    lawn = textures.mix(
        (0.07, 0.14, 0.03), (0.16, 0.24, 0.07), textures.noise((512, 512), (160, 160), SEED + 1)
    )
    return [
        (panel((-4, GROUND, 4), (8, 0, 0), (0, 0, -8)), textured(stones)),
        (panel((-30, GROUND - 0.03, 30), (60, 0, 0), (0, 0, -60)), textured(lawn)),
    ]


def house() -> Pieces:
    """Return the house along the left side, with a door, a window, eaves and a chimney."""
    x, wall = -2.6, (0.62, 0.56, 0.46)
    boards = textures.wood((256, 128), (0.10, 0.17, 0.16), (0.16, 0.25, 0.24), SEED + 2)
    roof = sheet(
        np.array([[[x - 3, GROUND + 4.6, z], [x + 0.5, GROUND + 2.9, z]] for z in (-5.5, 4.5)])
    )
    glass = box((0.02, 1.0, 1.2)).at(x + 0.012, GROUND + 1.5, 0.9)
    frame = [box((0.08, 1.12, 0.06)).at(x + 0.02, GROUND + 1.5, z) for z in (0.28, 0.9, 1.52)] + [
        box((0.08, 0.06, 1.3)).at(x + 0.02, GROUND + y, 0.9) for y in (0.97, 2.03)
    ]
    return [
        (box((5.0, 2.9, 9.0)).at(x - 2.5, GROUND + 1.45, -0.5), diffuse(*wall)),
        (roof, both_sides(diffuse(0.32, 0.13, 0.09))),
        (box((0.5, 1.6, 0.7)).at(x - 0.9, GROUND + 4.2, -1.4), diffuse(0.35, 0.16, 0.11)),
        (box((0.06, 2.05, 0.9)).at(x + 0.02, GROUND + 1.03, -1.3), textured(boards)),
        (glass, diffuse(0.05, 0.06, 0.07)),
        (join(frame), diffuse(0.72, 0.72, 0.70)),
    ]


def fence() -> Pieces:
    """Return a fence of slats along the back, and a low wall along the right side."""
    slats = [box((0.11, 1.7, 0.025)).at(x, GROUND + 0.9, 3.9) for x in np.arange(-2.4, 4.0, 0.155)]
    rails = [box((6.6, 0.07, 0.04)).at(0.7, GROUND + y, 3.94) for y in (0.35, 1.45)]
    wood = textures.wood((128, 256), TEAK_DARK, TEAK_LIGHT, SEED + 3)
    return [
        (join([*slats, *rails]), textured(wood)),
        (box((0.3, 0.9, 8.0)).at(4.15, GROUND + 0.45, 0), diffuse(0.48, 0.44, 0.40)),
    ]


def tree() -> Pieces:
    """Return a tree with a crown of single leaves."""
    rng = np.random.default_rng(SEED + 4)
    x, z, top = 1.9, -2.3, GROUND + 2.3
    trunk = np.array([[x, GROUND, z], [x + 0.06, GROUND + 1.1, z], [x, top, z + 0.05]])
    limbs, leaves = [tube(trunk, np.array([0.13, 0.10, 0.07]))], []
    for _ in range(14):
        away = rng.normal(size=3) * (0.55, 0.3, 0.55) + (0, 0.55, 0)
        end = np.array([x, top, z]) + away
        limbs.append(tube(np.linspace((x, top - 0.3, z), end, 4), np.linspace(0.05, 0.012, 4)))
        for _ in range(42):
            spot = end + rng.normal(size=3) * (0.3, 0.22, 0.3)
            leaf = panel((-0.05, -0.08, 0), (0.1, 0, 0), (0, 0.16, 0))
            for axis in "xyz":
                leaf = leaf.turned(axis, rng.uniform(0, 360))
            leaves.append(leaf.at(*spot))
    return [
        (join(limbs), diffuse(0.17, 0.12, 0.08)),
        (join(leaves), both_sides(diffuse(0.10, 0.24, 0.05))),
    ]


def furniture() -> Pieces:
    """Return a bench, a round table and a flower pot."""
    wood = textures.wood((128, 512), TEAK_DARK, TEAK_LIGHT, SEED + 5)
    boards = [box((1.5, 0.035, 0.11)).at(0, 0.44, 0.13 * k) for k in range(3)]
    boards += [box((1.5, 0.10, 0.03)).at(0, 0.62 + 0.16 * k, 0.36) for k in range(2)]
    legs = [box((0.05, 0.44, 0.36)).at(s * 0.62, 0.22, 0.13) for s in (-1, 1)]
    legs += [box((0.05, 0.86, 0.05)).at(s * 0.62, 0.43, 0.38) for s in (-1, 1)]
    bench = join([*boards, *legs]).at(0.4, GROUND, 2.4)
    table = join([cylinder(0.42, 0.03).at(0, 0.70, 0), cylinder(0.03, 0.70)])
    outline = [(0, 0), (0.16, 0), (0.22, 0.34), (0.24, 0.36), (0.21, 0.36), (0.19, 0.3), (0, 0.3)]
    pot = lathe(outline)
    bush = sphere(0.27).at(0, 0.55, 0)
    return [
        (bench, textured(wood)),
        (table.at(1.7, GROUND, 0.9), diffuse(0.60, 0.60, 0.58)),
        (pot.at(-1.9, GROUND, -3.0), both_sides(glossy((0.42, 0.17, 0.10), 0.4))),
        (bush.at(-1.9, GROUND, -3.0), diffuse(0.08, 0.20, 0.05)),
    ]


def build(sun: tuple[float, float, float] = SUN) -> dict[str, Any]:
    """Return all parts of the yard, with the sky and a sun in a direction, of unit `IRRADIANCE`.

    The sun lights the yard but is not seen by rays.
    """
    mi = mitsuba()
    pieces = [*ground(), *house(), *fence(), *tree(), *furniture()]
    parts = {f"part{i:03d}": mitsuba_mesh(solid, bsdf) for i, (solid, bsdf) in enumerate(pieces)}
    dark = (0.0, 0.0, 0.0)
    outside = textures.sky(1024, sun=sun, sun_radiance=dark, sun_radius_deg=0.3, seed=SEED)
    # Mitsuba's environment has the direction -z at its edges, the scene format in its middle.
    bitmap = mi.Bitmap(np.roll(0.35 * outside, 512, axis=1))
    return parts | {
        "outside": {"type": "envmap", "bitmap": bitmap},
        "sun": {
            "type": "directional",
            "direction": [-part for part in sun],
            "irradiance": {"type": "rgb", "value": list(IRRADIANCE)},
        },
    }
