#!/usr/bin/env python3
"""Make the pictures of the demo scene: `python docs/comparison.py`.

Writes docs/demo.jpg, the scene with objects, and docs/comparison.png: a part of it as the input,
as iprt and image-based lighting render it, and as path-traced truth.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import iprt
from iprt.files.images import read_color
from iprt.output.display import display
from iprt.output.picture import write_display_png

FOLDER = Path(__file__).resolve().parent
PART = (slice(240, 640), slice(240, 740))
"""Rows and columns of docs/comparison.png."""
GAP = 6
FRAMES = 64


def main() -> None:
    scene = iprt.Scene.open(FOLDER.parent / "scenes360" / "lounge")
    entry = scene.views["lounge"]
    assert entry.truth is not None
    device = iprt.ComputeDevice(iprt.choose_device())

    def rendered(method: str, names: tuple[str, ...]) -> NDArray[np.float32]:
        settings = iprt.Settings(method=method, fading=0.0)
        objects = scene.instances_of("lounge") if names else ()
        with iprt.Renderer(device, scene.frame(), objects, entry.view, settings) as renderer:
            return renderer.render(frames=FRAMES).color

    ours = rendered("iprt", entry.objects)
    pixels = np.rint(255.0 * display(ours, scene.exposure)).astype(np.uint8)
    Image.fromarray(pixels).save(FOLDER / "demo.jpg", quality=95, subsampling=0, optimize=True)
    shown = [rendered("iprt", ()), ours, rendered("ibl", entry.objects), read_color(entry.truth)]
    gap = np.ones((PART[0].stop - PART[0].start, GAP, 3))
    parts = [part for image in shown for part in (display(image, scene.exposure)[PART], gap)]
    write_display_png(FOLDER / "comparison.png", np.concatenate(parts[:-1], axis=1))


if __name__ == "__main__":
    main()
