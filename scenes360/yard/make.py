"""Render `scenes360/yard`: `python -m scenes360.yard.make` from the repository's root.

Writes the panorama, its depth, the objects' meshes, the truth of the view and the scene.toml. Needs
the `reference` extra.
"""

from __future__ import annotations

from pathlib import Path

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from scenes360.room.make import Placed, read_flags, write_scene
from scenes360.room.objects import objects
from scenes360.yard import model

FOLDER = Path(__file__).resolve().parent
PANORAMA = View(1024, 512, projection="equirect")
VIEW = View(384, 384, 88.0, -31.0, 30.0)
EXPOSURE = 0.2
GROUND = model.GROUND
OBJECTS = {
    "pot": Placed(Material("plastic", (0.50, 0.05, 0.04), 0.08), 28, (2.02, GROUND, 0.16)),
    "vase": Placed(Material("diffuse", (0.75, 0.70, 0.60)), 0, (2.42, GROUND, -0.30)),
    "ball": Placed(Material("conductor", (0.92, 0.92, 0.92), 0.0), 0, (2.62, GROUND, 0.22)),
}


def main() -> None:
    """Write the scene folder."""
    write_scene(
        read_flags(__doc__, FOLDER, spp=128, truth_spp=512),
        "yard",
        model.build(),
        {name: solid for name, solid in objects().items() if name in OBJECTS},
        OBJECTS,
        PANORAMA,
        VIEW,
        exposure=EXPOSURE,
        glossy={},
    )


if __name__ == "__main__":
    main()
