#!/usr/bin/env python3
"""Measure how far textures flicker in a turning head: `python docs/texture_flicker.py FOLDER`.

A finely textured board is seen from the front, at a grazing angle, in a mirror and in a rough
metal, all under even light, while the head turns by a third of a pixel a frame. The last frames
are compared with references, means of 256 points a pixel of a finer view, which FOLDER keeps with
the pictures. Remove them there when the scene changes. The table tells the error, its change from
frame to frame, and the time of a frame.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.output.display import display
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.meshes import mesh_of, transform
from tests.worlds import sphere_frame

VIEW = View(96, 64, fov_y_deg=20.0)
FRAMES, COMPARED = 16, 6
TURN = 0.33
"""Pixels by which the head turns in a frame."""
FINER = 4
"""Factor of the size of the view that a reference is made of."""
SETTLED = 16
"""Frames of it, each of `FINER` x `FINER` points a pixel."""
TEXELS = 512

Float = NDArray[np.float64]


def leaves() -> NDArray[np.float32]:
    """Return a checker of two texels a square beside spots, both in many colors."""
    random = np.random.default_rng(1)
    y, x = np.mgrid[0:TEXELS, 0:TEXELS]
    checker = np.where((x // 2 + y // 2) % 2, 0.9, 0.05)
    spots = random.random((TEXELS, TEXELS)) ** 3
    kind = np.where(x < TEXELS // 2, checker, spots)[..., None]
    return (kind * (0.5 + 0.5 * random.random((TEXELS, TEXELS, 3)))).astype(np.float32)


def board(
    material: Material, place: tuple[float, ...], x: tuple[float, ...], y: tuple[float, ...]
) -> Instance:
    """Return a square of sides 2 x and 2 y about a place."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64)
    axes = np.stack([x, y, np.cross(x, y)], axis=-1)
    uvs = 0.5 * (corners[:, :2] + 1.0)
    normal = np.tile([0.0, 0.0, 1.0], (4, 1))
    shape = mesh_of(corners, [[0, 1, 2], [0, 2, 3]], (material,), normal, uvs)
    shape = replace(shape, material_index=np.zeros(2, np.int32))
    return Instance("board", shape, transform(axes, place))


def scenes() -> dict[str, list[Instance]]:
    """Return the objects of each scene."""
    leafy = Material(albedo=(1.0, 1.0, 1.0), texture=leaves())
    front = board(leafy, (0.0, 0.0, -4.0), (1.2, 0.0, 0.0), (0.0, 0.8, 0.0))
    grazing = board(leafy, (0.0, -0.6, -4.0), (1.0, 0.0, 0.0), (0.0, 0.15, -2.0))
    behind = board(leafy, (0.0, 0.0, 2.0), (-1.2, 0.0, 0.0), (0.0, 0.8, 0.0))
    found = {"front": [front], "grazing": [grazing]}
    for name, alpha in (("mirror", 0.0), ("metal, α = 0.1", 0.1)):
        metal = Material("conductor", (0.9, 0.9, 0.9), alpha=alpha)
        found[name] = [board(metal, (0.0, 0.0, -2.0), (0.45, 0.0, 0.0), (0.0, 0.3, 0.0)), behind]
    return found


def turned(number: int, view: View = VIEW) -> View:
    """Return the view of a frame."""
    pixel = np.degrees(VIEW.pixel_angle)
    return replace(view, yaw_deg=number * TURN * pixel, pitch_deg=0.4 * number * TURN * pixel)


class Bench:
    """The scene's objects in an evenly lit sphere."""

    def __init__(self, objects: list[Instance]) -> None:
        self.device = ComputeDevice(choose_device())
        self.frame, self.objects = sphere_frame(6.0, 64, 32, 1.0), objects

    def played(self) -> tuple[Float, NDArray[np.bool_], float]:
        """Return the last frames, where the objects fill them, and the median time in ms."""
        shown, covered, times = [], [], []
        settings = Settings(gbuffer="cl")
        with Renderer(self.device, self.frame, self.objects, turned(0), settings) as renderer:
            for number in range(FRAMES):
                renderer.look(turned(number))
                start = perf_counter()
                picture = renderer.render(1, ("coverage",))
                times.append(1e3 * (perf_counter() - start))
                shown.append(display(picture.color))
                covered.append(picture.aovs["coverage"] == 1.0)
        last = slice(-COMPARED, None)
        return np.stack(shown[last]), np.stack(covered[last]), median(times[last])

    def reference(self, number: int) -> Float:
        """Return the converged picture of a frame."""
        fine = turned(number, VIEW.resized(FINER * VIEW.width, FINER * VIEW.height))
        settings = Settings(gbuffer="cl", fading=0.0, atrous={"levels": 0})
        with Renderer(self.device, self.frame, self.objects, fine, settings) as renderer:
            color = renderer.render(SETTLED).color.astype(np.float64)
        return display(color.reshape(VIEW.height, FINER, VIEW.width, FINER, 3).mean(axis=(1, 3)))


def references(bench: Bench, file: Path) -> NDArray[np.float64]:
    """Return the references of a scene, which `file` keeps."""
    if not file.exists():
        numbers = range(FRAMES - COMPARED, FRAMES)
        np.save(file, np.stack([bench.reference(number) for number in numbers]))
    return np.asarray(np.load(file))


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    print("| scene | error | flicker | ms |", "|---|---:|---:|---:|", sep="\n")
    for name, objects in scenes().items():
        bench, file = Bench(objects), name.partition(",")[0]
        shown, covered, time = bench.played()
        wanted = references(bench, folder / f"{file}.npy")
        error = 255.0 * (shown - wanted)
        rms = np.sqrt(np.square(error[covered]).mean())
        flicker = np.sqrt(np.square(np.diff(error, axis=0)[covered[1:] & covered[:-1]]).mean())
        pair = np.concatenate([shown[-1], wanted[-1]], axis=1)
        Image.fromarray(np.uint8(255.0 * pair + 0.5)).save(folder / f"{file}.png")
        print(f"| {name} | {rms:.2f} | {flicker:.2f} | {time:.1f} |", flush=True)


if __name__ == "__main__":
    main()
