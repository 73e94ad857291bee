"""Render `scenes360/yard`: `python -m scenes360.yard.make` from the repository's root.

Writes the panorama, its depth, the objects' meshes, the truth of the view and the scene.toml. Needs
the `reference` extra.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from scenes360.modelling import write_ply
from scenes360.room.make import (
    Placed,
    head_toml,
    mitsuba_object,
    object_toml,
    render_view,
    truth_toml,
    view_toml,
    write_panorama,
)
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
LOG = logging.getLogger("scenes360")


def main() -> None:
    """Write the scene folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spp", type=int, default=128, help="paths per pixel of the panorama")
    parser.add_argument("--truth-spp", type=int, default=512, help="of the view's truth")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder to write to")
    options = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    meshes = {name: objects()[name] for name in OBJECTS}
    for name, solid in meshes.items():
        write_ply(options.out / "meshes" / f"{name}.ply", solid)
    parts = model.build()
    LOG.info("panorama")
    write_panorama(options.out, parts, PANORAMA, spp=options.spp, lossy=True)
    LOG.info("view")
    inserted = {name: mitsuba_object(meshes[name], placed) for name, placed in OBJECTS.items()}
    crops = render_view(options.out / "truth", "yard", VIEW, parts, inserted, options.truth_spp)
    manifest = [
        head_toml("yard", EXPOSURE),
        *(object_toml(name, placed) for name, placed in OBJECTS.items()),
        view_toml("yard", VIEW, tuple(OBJECTS)) + truth_toml("yard", crops),
    ]
    (options.out / "scene.toml").write_text("\n".join(manifest))


if __name__ == "__main__":
    main()
