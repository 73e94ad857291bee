"""Make the page of materials: `python -m docs.materials` from the repository's root.

Writes docs/materials.md and a picture for each parameter: a ball on the table of scenes360/room,
as iprt renders it and as Mitsuba path-traces it in the full geometry. Needs the `reference` extra.
Path-traced pictures stay in out/materials, so that a second run is quick.
"""

from __future__ import annotations

import argparse
import hashlib
from dataclasses import dataclass, fields
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import iprt
from docs.material_costs import LOBES, MEASURED, costs
from docs.material_costs import SIZE as COST_SIZE
from docs.material_rows import PLASTIC, ROWS, Row
from iprt.files.images import read_color
from iprt.geometry.camera import View
from iprt.geometry.material import NORMAL_MAPS, Material
from iprt.geometry.mesh import Instance, tangent_mesh
from iprt.measure.combinations import still_settings
from iprt.measure.metrics import ssim
from iprt.measure.video_stability import SHOWN, over_background
from iprt.measure.view_truth import Target
from iprt.output.display import display
from iprt.output.picture import write_exr
from iprt.truth.model import load_scene, render_color
from iprt.truth.shapes import instance_shapes
from scenes360.modelling import sphere
from scenes360.room import model, plan
from tests.meshes import mesh_of

FOLDER = Path(__file__).resolve().parent
KEPT = FOLDER.parent / "out" / "materials"
PICTURES = FOLDER / "materials"
SIZE, GAP, RADIUS = 144, 4, 0.11
VIEW = View(SIZE, SIZE, 3.3, -34.7, 11.5)
FOOT = (0.08, plan.TABLE_TOP, -1.4)
FRAMES = 64

INTRODUCTION = """# Materials

*Made by `python -m docs.materials`.*

A row for each parameter of a material, with a ball on the table of `scenes360/room` for each value:
above as `iprt` renders it after {frames} frames, below as Mitsuba path-traces it in the full
geometry ({spp} paths per pixel, denoised). SSIM of the displayed pictures, over the truth's
background.

Parameters are keys of `material` in scene.toml, and fields of the viewer. Maps come from mesh
files: glTF, OBJ with MTL, and USD; [meshes.md](meshes.md) says how these files' materials are read.
Colors are linear Rec.709.

Mitsuba has no clearcoat, sheen or tint as glTF defines them: `iprt/truth/covered.py` adds them to
it, independently of the renderer.

| parameter | meaning | iprt above, Mitsuba below | SSIM |
| --- | --- | --- | --- |
"""


PRICES = """
## Price

Time of a frame while the head turns, {size}x{size}, with a ball of each material in the middle,
relative to a ball of plastic: frames by turns in one process, medians of {frames}. Two runs differ
by up to 0.08. The ball of plastic takes {plain:.0f} ms on {device}.

| material of the ball | time |
| --- | ---: |
"""


@dataclass
class Bench:
    """The table of the room, with and without a ball."""

    spp: int

    def __post_init__(self) -> None:
        self.parts = model.build()
        self.scene = iprt.Scene.open(FOLDER.parent / "scenes360" / "room")
        self.frame = self.scene.frame()
        self.device = iprt.ComputeDevice(iprt.choose_device())
        self.background = self._kept("background", {})

    def _kept(self, name: str, shapes: dict[str, Any]) -> NDArray[np.float32]:
        """Return a path-traced picture, from a file if it was made before."""
        path = KEPT / f"{name}-{SIZE}-{self.spp}.exr"
        if not path.is_file():
            KEPT.mkdir(parents=True, exist_ok=True)
            scene = load_scene({**self.parts, **shapes})
            write_exr(path, render_color(scene, VIEW, spp=self.spp, seed=1))
        return read_color(path)

    def compared(self, material: Material) -> tuple[NDArray[np.float64], float]:
        """Return both pictures of a ball, one above the other, and their SSIM."""
        ball = (ball_of(material),)
        truth = self._kept(digest(material), instance_shapes(ball))
        target = Target(
            "room", "table", 0, VIEW, (), self.scene.exposure, truth, self.background, ()
        )
        settings = still_settings(iprt.Settings(), 0)
        with iprt.Renderer(self.device, self.frame, ball, VIEW, settings) as renderer:
            color = over_background(renderer.render(FRAMES, SHOWN), target)
        shown = display(color, self.scene.exposure)
        return np.concatenate([shown, target.shown]), ssim(shown, target.shown)


def ball_of(material: Material) -> Instance:
    """Return a ball on the table."""
    solid = sphere(RADIUS, segments=128).at(0.0, RADIUS, 0.0)
    mesh = mesh_of(solid.positions, solid.triangles, (material,), solid.normals, solid.uvs)
    bumpy = any(material.maps[at] is not None for at in NORMAL_MAPS)
    mesh = tangent_mesh(mesh) if bumpy else mesh
    to_world = np.eye(4)
    to_world[:3, 3] = FOOT
    return Instance("ball", mesh, to_world)


def digest(material: Material) -> str:
    """Return a short name that is another for any other value of a material."""
    name = hashlib.blake2b(digest_size=8)
    for field in fields(material):
        value = getattr(material, field.name)
        name.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
    return name.hexdigest()


def prices(bench: Bench) -> str:
    """Return the table of times."""
    balls = [ball_of(material) for material in LOBES.values()]
    times = costs(bench.device, bench.frame, balls, ball_of(PLASTIC))
    head = PRICES.format(
        size=COST_SIZE,
        frames=MEASURED,
        plain=median(plain for _, plain in times),
        device=bench.device.name,
    )
    rows = zip(LOBES, times, strict=True)
    return head + "".join(f"| {name} | {one / plain:.2f} |\n" for name, (one, plain) in rows)


def row_of(bench: Bench, row: Row) -> str:
    """Write the picture of a row, and return the row of the table."""
    cells, scores = [], []
    for material in row.materials:
        picture, score = bench.compared(material)
        cells.append(np.pad(picture, ((0, 0), (0, GAP), (0, 0)), constant_values=1.0))
        scores.append(f"{score:.3f}")
        print(row.name, scores[-1], flush=True)
    image = np.concatenate(cells, axis=1)[:, :-GAP]
    pixels = np.rint(255.0 * image).astype(np.uint8)
    PICTURES.mkdir(exist_ok=True)
    Image.fromarray(pixels).save(PICTURES / f"{row.name}.jpg", quality=92, subsampling=0)
    return row.markdown(" / ".join(scores))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spp", type=int, default=256, help="paths per pixel of Mitsuba")
    bench = Bench(parser.parse_args().spp)
    head = INTRODUCTION.format(frames=FRAMES, spp=bench.spp)
    rows = [row_of(bench, row) if row.materials else row.markdown("") for row in ROWS]
    page = head + "\n".join(rows) + "\n" + prices(bench)
    (FOLDER / "materials.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
