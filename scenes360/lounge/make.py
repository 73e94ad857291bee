"""Render `scenes360/lounge`: `python -m scenes360.lounge.make` from the repository's root.

Writes the panorama, its depth, the objects' meshes, the truth of the view and the scene.toml. Needs
the `reference` extra.
"""

from __future__ import annotations

from pathlib import Path

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from scenes360.lounge import model
from scenes360.modelling import sphere
from scenes360.room import plan
from scenes360.room.make import Placed, read_flags, write_scene
from scenes360.room.objects import objects

FOLDER = Path(__file__).resolve().parent
PANORAMA = View(4096, 2048, projection="equirect")
VIEW = View(960, 640, -17.0, -26.0, 54.0)
EXPOSURE = 1.25
BALL_RADIUS = 0.19
OBJECTS = {
    "pot": Placed(Material("plastic", (0.50, 0.05, 0.04), 0.08), 28, (0.02, plan.TABLE_TOP, -1.30)),
    "vase": Placed(Material("diffuse", (0.75, 0.70, 0.60)), 0, (0.36, plan.TABLE_TOP, -1.60)),
    "knot": Placed(Material("conductor", (0.95, 0.73, 0.38), 0.15), -25, (-0.78, plan.RUG, -1.12)),
    "ball": Placed(Material("conductor", (0.92, 0.92, 0.92), 0.0), 0, (-1.22, plan.FLOOR, -2.02)),
}
GLOSSY = {
    "floor": (plan.FLOOR, model.FLOOR_ALPHA),
    "table": (plan.TABLE_TOP, plan.TABLE_ALPHA),
}


def main() -> None:
    """Write the scene folder."""
    write_scene(
        read_flags(__doc__, FOLDER, spp=64, truth_spp=256),
        "lounge",
        model.build(),
        {**objects(), "ball": sphere(BALL_RADIUS, segments=72).at(0, BALL_RADIUS, 0)},
        OBJECTS,
        PANORAMA,
        VIEW,
        exposure=EXPOSURE,
        glossy=GLOSSY,
    )


if __name__ == "__main__":
    main()
