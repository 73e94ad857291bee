#!/usr/bin/env python3
"""Make the strip of frames in docs/guide.md: `python docs/clip.py` writes docs/clip.png.

Plays the clip `scenes360/train` once, and shows some of its frames side by side.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.film import Film
from iprt.output.display import display
from iprt.output.picture import write_display_png
from iprt.scene.scene import Scene
from iprt.settings.model import Settings

FOLDER = Path(__file__).resolve().parent
SHOWN = (3, 9, 15, 21)
SIZE = (240, 180)
"""Size of each frame, in pixels."""
GAP = 4


def main() -> None:
    scene = Scene.open(FOLDER.parent / "scenes360" / "train")
    entry = scene.views["rug"]
    view = replace(entry, view=entry.view.resized(*SIZE))
    device = ComputeDevice(choose_device())
    strip = []
    with Film(scene, device, Settings(), view=view, accumulate=4) as film:
        for index, picture in film.frames(range(max(SHOWN) + 1)):
            if index in SHOWN:
                strip += [display(picture.color, scene.exposure), np.ones((SIZE[1], GAP, 3))]
    write_display_png(FOLDER / "clip.png", np.concatenate(strip[:-1], axis=1))


if __name__ == "__main__":
    main()
