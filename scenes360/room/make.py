"""Render `scenes360/room`: `python -m scenes360.room.make` from the repository's root.

Writes the panorama, its depth, the objects' meshes, the truth of the views and the scene.toml.
Needs the `reference` extra.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.output.picture import write_exr
from iprt.truth.model import Parts, load_scene, render_color, render_geometry, render_mask
from iprt.truth.shapes import bsdf_of, mitsuba_mesh
from scenes360.files import cuts, rounded, toml_matrix, write_planes
from scenes360.modelling import Solid, write_ply
from scenes360.room import model, plan
from scenes360.room.objects import objects

FOLDER = Path(__file__).resolve().parent
PANORAMA = View(1024, 512, projection="equirect")
VIEW_SIZE = 512
SEED = 1
EXPOSURE = 1.5
LOG = logging.getLogger("scenes360")


class Standing(Protocol):
    """Object with a material and a position."""

    @property
    def material(self) -> Material:
        """Material of the object."""

    @property
    def to_world(self) -> np.ndarray:
        """4x4 transform to world space."""


@dataclass(frozen=True)
class Placed:
    """Inserted object: its material, its rotation about +Y and its position."""

    material: Material
    turn_deg: float
    foot: tuple[float, float, float]

    @property
    def to_world(self) -> np.ndarray:
        """Return its 4x4 transform to world space."""
        c, s = np.cos(np.deg2rad(self.turn_deg)), np.sin(np.deg2rad(self.turn_deg))
        x, y, z = self.foot
        return np.array([[c, 0, s, x], [0, 1, 0, y], [-s, 0, c, z], [0, 0, 0, 1.0]])


OBJECTS = {
    "pot": Placed(Material("plastic", (0.50, 0.05, 0.04), 0.08), 28, (0.08, plan.TABLE_TOP, -1.34)),
    "vase": Placed(Material("diffuse", (0.75, 0.70, 0.60)), 0, (0.37, plan.TABLE_TOP, -1.60)),
    "knot": Placed(Material("conductor", (0.95, 0.73, 0.38), 0.15), -25, (-0.80, plan.RUG, -1.02)),
    "ball": Placed(Material("conductor", (0.92, 0.92, 0.92), 0.0), 0, (-0.68, plan.RUG, -1.55)),
}
VIEWS = {
    "table": (View(VIEW_SIZE, VIEW_SIZE, 8.0, -33.0, 42.0), ("pot", "vase")),
    "rug": (View(VIEW_SIZE, VIEW_SIZE, -34.0, -41.0, 46.0), ("knot", "ball")),
}
GLOSSY = {
    "floor": (plan.FLOOR, plan.FLOOR_ALPHA),
    "table": (plan.TABLE_TOP, plan.TABLE_ALPHA),
}
"""Height and roughness of the coated surfaces that objects are reflected in, as modelled."""
OVERVIEW = View(960, 640, -8.0, -18.0, 72.0)
"""View of everything, without ground truth."""


def main() -> None:
    """Write the scene folder."""
    options = read_flags(__doc__, FOLDER, spp=128, truth_spp=512)
    meshes = objects()
    for name, solid in meshes.items():
        write_ply(options.out / "meshes" / f"{name}.ply", solid)
    parts = model.build()
    LOG.info("panorama")
    write_panorama(options.out, parts, PANORAMA, spp=options.spp)
    manifest = [
        head_toml("room", EXPOSURE),
        *(glossy_toml(name, *how) for name, how in GLOSSY.items()),
    ]
    manifest += [object_toml(name, placed) for name, placed in OBJECTS.items()]
    for name, (view, names) in VIEWS.items():
        LOG.info("view %s", name)
        inserted = {n: mitsuba_object(meshes[n], OBJECTS[n]) for n in names}
        crops = render_view(options.out / "truth", name, view, parts, inserted, options.truth_spp)
        manifest.append(view_toml(name, view, names) + truth_toml(name, crops))
    manifest.append(view_toml("room", OVERVIEW, tuple(OBJECTS)))
    (options.out / "scene.toml").write_text("\n".join(manifest))


def read_flags(doc: str, folder: Path, *, spp: int, truth_spp: int) -> argparse.Namespace:
    """Read `spp`, `truth_spp` and `out` from the command line, and log to the terminal."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--spp", type=int, default=spp, help="paths per pixel of the panorama")
    parser.add_argument("--truth-spp", type=int, default=truth_spp, help="of the views' truth")
    parser.add_argument("--out", type=Path, default=folder, help="folder to write to")
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    return parser.parse_args()


def write_scene(
    options: argparse.Namespace,
    name: str,
    parts: Parts,
    meshes: Mapping[str, Solid],
    objects: Mapping[str, Placed],
    panorama: View,
    view: View,
    *,
    exposure: float,
    glossy: Mapping[str, tuple[float, float]],
) -> None:
    """Write a scene folder with one view, which shows all objects.

    `glossy` has height and roughness of coated surfaces. `options` are from `read_flags`.
    """
    for each, solid in meshes.items():
        write_ply(options.out / "meshes" / f"{each}.ply", solid)
    LOG.info("panorama")
    write_panorama(options.out, parts, panorama, spp=options.spp, lossy=True)
    LOG.info("view")
    inserted = {each: mitsuba_object(meshes[each], placed) for each, placed in objects.items()}
    crops = render_view(options.out / "truth", name, view, parts, inserted, options.truth_spp)
    manifest = [
        head_toml(name, exposure),
        *(glossy_toml(each, *how) for each, how in glossy.items()),
        *(object_toml(each, placed) for each, placed in objects.items()),
        view_toml(name, view, tuple(objects)) + truth_toml(name, crops),
    ]
    (options.out / "scene.toml").write_text("\n".join(manifest))


def write_panorama(
    folder: Path, parts: Parts, panorama: View, *, spp: int, lossy: bool = False
) -> None:
    """Write color.exr, half floats (`lossy`: see `write_planes`), and depth.exr."""
    color = render_color(load_scene(parts), panorama, spp=spp, seed=SEED).astype(np.float16)
    planes = dict(zip("RGB", np.moveaxis(color, -1, 0), strict=True))
    write_planes(folder / "color.exr", planes, lossy=lossy)
    write_planes(folder / "depth.exr", {"Z": rounded(render_geometry(parts, panorama)[0])})


def mitsuba_object(solid: Solid, placed: Placed) -> object:
    """Return the Mitsuba shape of a placed solid."""
    world = solid.turned("y", placed.turn_deg).at(*placed.foot)
    return mitsuba_mesh(world, bsdf_of(placed.material))


def render_view(
    folder: Path, name: str, view: View, parts: Parts, inserted: Parts, spp: int
) -> list[list[int]]:
    """Write truth, background and mask of a view; return the cuts around its objects."""
    truth = render_color(load_scene({**parts, **inserted}), view, spp=spp, seed=SEED)
    background = render_color(load_scene(parts), view, spp=spp, seed=SEED)
    mask = render_mask(parts, inserted, view, seed=SEED)
    write_exr(folder / f"{name}.exr", truth, half=True)
    write_exr(folder / f"{name}_background.exr", background, half=True)
    write_planes(folder / f"{name}_mask.exr", {"Y": mask.astype(np.float16)})
    shown = [np.clip(image, 0, 1) ** (1 / 2.2) for image in (truth, background)]
    return cuts(mask, np.abs(shown[0] - shown[1]).max(axis=-1))


def head_toml(name: str, exposure: float) -> str:
    """Return the head of scene.toml."""
    return f"""# Written by make.py.
format = 1
name = "{name}"
exposure = {exposure:g}

[video]
color = "color.exr"
depth = "depth.exr"
frames = [0, 0]
fps = 30.0
loop = false
"""


def glossy_toml(name: str, height: float, alpha: float) -> str:
    """Return the TOML table of a glossy real surface."""
    return f"""[[real_materials]]
name = "{name}"
kind = "plastic"
alpha = {alpha:g}
ior = 1.5
plane = {{ point = [0, {height:g}, 0], normal = [0, 1, 0], tolerance = 0.006 }}
"""


def object_toml(name: str, placed: Standing) -> str:
    """Return the TOML table of an object."""
    material = placed.material
    color = ", ".join(f"{c:g}" for c in material.albedo)
    looks = {
        "diffuse": f"albedo = [{color}]",
        "conductor": f"reflectance = [{color}], alpha = {material.alpha:g}",
        "plastic": f"albedo = [{color}], alpha = {material.alpha:g}, ior = {material.ior:g}",
    }[material.kind]
    return f"""[[objects]]
name = "{name}"
mesh = "meshes/{name}.ply"
to_world = {toml_matrix(placed.to_world)}
material = {{ kind = "{material.kind}", {looks} }}
"""


def view_toml(name: str, view: View, objects: tuple[str, ...]) -> str:
    """Return the TOML table of a view."""
    names = ", ".join(f'"{n}"' for n in objects)
    return f"""[[views]]
name = "{name}"
yaw_deg = {view.yaw_deg:g}
pitch_deg = {view.pitch_deg:g}
fov_y_deg = {view.fov_y_deg:g}
size = [{view.width}, {view.height}]
objects = [{names}]
"""


def truth_toml(name: str, crops: list[list[int]]) -> str:
    """Return the TOML table of a view's ground truth."""
    return f"""truth = "truth/{name}.exr"
truth_background = "truth/{name}_background.exr"
truth_mask = "truth/{name}_mask.exr"
cuts = {crops}
"""


if __name__ == "__main__":
    main()
