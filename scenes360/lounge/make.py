"""Render `scenes360/lounge`: `python -m scenes360.lounge.make` from the repository's root.

Writes the panorama, its depth, the objects' meshes, the truth of the view and the scene.toml. Needs
the `reference` extra.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from scenes360.lounge import model
from scenes360.modelling import sphere, write_ply
from scenes360.room import plan
from scenes360.room.make import (
    Placed,
    glossy_toml,
    head_toml,
    mitsuba_object,
    object_toml,
    render_view,
    truth_toml,
    view_toml,
    write_panorama,
)
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
LOG = logging.getLogger("scenes360")


def main() -> None:
    """Write the scene folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spp", type=int, default=64, help="paths per pixel of the panorama")
    parser.add_argument("--truth-spp", type=int, default=256, help="of the view's truth")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder to write to")
    options = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    meshes = {**objects(), "ball": sphere(BALL_RADIUS, segments=72).at(0, BALL_RADIUS, 0)}
    for name, solid in meshes.items():
        write_ply(options.out / "meshes" / f"{name}.ply", solid)
    parts = model.build()
    LOG.info("panorama")
    write_panorama(options.out, parts, PANORAMA, spp=options.spp, lossy=True)
    LOG.info("view")
    inserted = {name: mitsuba_object(meshes[name], placed) for name, placed in OBJECTS.items()}
    crops = render_view(options.out / "truth", "lounge", VIEW, parts, inserted, options.truth_spp)
    manifest = [
        head_toml("lounge", EXPOSURE),
        *(glossy_toml(name, *how) for name, how in GLOSSY.items()),
        *(object_toml(name, placed) for name, placed in OBJECTS.items()),
        view_toml("lounge", VIEW, tuple(OBJECTS)) + truth_toml("lounge", crops),
    ]
    (options.out / "scene.toml").write_text("\n".join(manifest))


if __name__ == "__main__":
    main()
