"""Render `scenes360/train`: `python -m scenes360.train.make` from the repository's root.

Writes the clip's color and depth, the inserted objects' meshes, the truth of some frames and the
scene.toml. Needs the `reference` extra.
"""

from __future__ import annotations

import argparse
import logging
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from iprt.files.images import read_color, read_depth
from iprt.geometry.camera import View
from iprt.geometry.keyframes import ObjectKeyframe, ObjectMotion
from iprt.geometry.material import Material
from iprt.output.picture import write_exr
from iprt.truth.model import load_scene, render_color, render_geometry
from iprt.truth.shapes import bsdf_of, mitsuba_mesh
from scenes360.files import write_planes
from scenes360.modelling import Solid, sphere, torus_knot, write_ply
from scenes360.room.make import object_toml, render_view, view_toml
from scenes360.train import model, plan
from scenes360.video import write_color, write_depth

FOLDER = Path(__file__).resolve().parent
PANORAMA = View(512, 256, projection="equirect")
VIEW = View(224, 168, -2.0, -43.0, 54.0)
TRUTH_FRAMES = (6, 7, 15, 16)
"""Two pairs of consecutive frames, so that changes between frames have ground truth too."""
SEED = 1
"""Seed of all frames, so that remaining noise is static."""
CRF = 4
DEPTH_SCALE = 1e-4
LOG = logging.getLogger("scenes360")


@dataclass(frozen=True)
class Inserted:
    """Inserted object: its mesh around the origin, its material, and its motion."""

    solid: Solid
    material: Material
    to_world: plan.Matrix
    keyframes: list[ObjectKeyframe]

    def part(self, time_s: float) -> object:
        """Return the Mitsuba shape at a time in seconds."""
        to_world = ObjectMotion.of(self.to_world, self.keyframes).at(time_s)
        turn, place = to_world[:3, :3], to_world[:3, 3]
        world = replace(
            self.solid,
            positions=self.solid.positions @ turn.T + place,
            normals=self.solid.normals @ turn.T,
        )
        return mitsuba_mesh(world, bsdf_of(self.material))


def inserted() -> dict[str, Inserted]:
    """Return the inserted objects by name."""
    ball = sphere(plan.BALL_RADIUS, segments=48).at(0, plan.BALL_RADIUS, 0)
    knot = torus_knot(2, 3, 0.14, 0.038, segments=120).turned("x", 90)
    knot = knot.at(0, -float(knot.positions[:, 1].min()), 0)
    red, gold = (0.60, 0.10, 0.03), (0.95, 0.73, 0.38)
    return {
        "ball": Inserted(ball, Material("plastic", red, 0.1), *plan.ball()),
        "knot": Inserted(knot, Material("conductor", gold, 0.15), *plan.knot()),
    }


def main() -> None:
    """Render and write the scene folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spp", type=int, default=24, help="paths per pixel of the panorama")
    parser.add_argument("--truth-spp", type=int, default=128, help="of the view's truth")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder to write to")
    parser.add_argument("--frames", type=Path, help="folder that keeps the frames as rendered")
    options = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    objects = inserted()
    for name, each in objects.items():
        write_ply(options.out / "meshes" / f"{name}.ply", each.solid)
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.frames or Path(scratch)
        for index in range(plan.FRAMES):
            render_frame(folder, index, options.spp)
        encode(options.out, folder)
    cuts = [render_truth(options.out, index, objects, options.truth_spp) for index in TRUTH_FRAMES]
    low, high = np.min(cuts, axis=0)[:2], np.max(cuts, axis=0)[2:]
    manifest = manifest_toml(objects, [*map(int, low), *map(int, high)])
    (options.out / "scene.toml").write_text(manifest)


def render_frame(folder: Path, index: int, spp: int) -> None:
    """Write color and depth of a frame of the panorama, unless they exist."""
    color, depth = frame_files(folder, index)
    if depth.exists():
        return
    LOG.info("frame %d", index)
    parts = model.build(index / plan.FPS)
    write_exr(color, render_color(load_scene(parts), PANORAMA, spp=spp, seed=SEED))
    write_planes(depth, {"Z": render_geometry(parts, PANORAMA)[0]})


def frame_files(folder: Path, index: int) -> tuple[Path, Path]:
    """Return the color and depth file of a frame."""
    return folder / f"color.{index:04d}.exr", folder / f"depth.{index:04d}.exr"


def encode(out: Path, folder: Path) -> None:
    """Write the clip's two files from the frames in a folder."""
    files = [frame_files(folder, index) for index in range(plan.FRAMES)]
    write_color(out / "color.mkv", (read_color(file) for file, _ in files), fps=plan.FPS, crf=CRF)
    depths = (read_depth(file)[0] for _, file in files)
    write_depth(out / "depth.mkv", depths, fps=plan.FPS, scale=DEPTH_SCALE)


def render_truth(out: Path, index: int, objects: dict[str, Inserted], spp: int) -> list[int]:
    """Write truth, background and mask of a frame; return the crop around the objects' effects."""
    LOG.info("truth %d", index)
    time_s = index / plan.FPS
    parts = {name: each.part(time_s) for name, each in objects.items()}
    name = f"rug.{index:04d}"
    crops = render_view(out / "truth", name, VIEW, model.build(time_s), parts, spp)
    return crops[1]


HEAD = f"""# Written by make.py.
format = 1
name = "train"
exposure = 1.5

[video]
color = "color.mkv"
depth = "depth.mkv"
depth_scale = {DEPTH_SCALE:g}
frames = [0, {plan.FRAMES - 1}]
fps = {plan.FPS:g}
loop = false
"""


def manifest_toml(objects: dict[str, Inserted], cut: list[int]) -> str:
    """Return scene.toml."""
    tables = [HEAD]
    for name, each in objects.items():
        tables.append(object_toml(name, each) + keyframes_toml(each.keyframes))
    truth = f"""truth = "truth/rug.%04d.exr"
truth_background = "truth/rug.%04d_background.exr"
truth_mask = "truth/rug.%04d_mask.exr"
cuts = [{cut}]
"""
    return "\n".join([*tables, view_toml("rug", VIEW, tuple(objects)) + truth])


def keyframes_toml(keyframes: list[ObjectKeyframe]) -> str:
    """Return the TOML of an object's keyframes."""
    rows = []
    for key in keyframes:
        name = "translation" if key.translation is not None else "rotation"
        values = ", ".join(f"{value:g}" for value in getattr(key, name))
        rows.append(f"  {{ time = {key.time:g}, {name} = [{values}] }},\n")
    return f"keyframes = [\n{''.join(rows)}]\n"


if __name__ == "__main__":
    main()
