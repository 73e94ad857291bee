#!/usr/bin/env python3
"""Make the picture of the viewer in docs/viewer.md: `python -m docs.viewer` writes docs/viewer.png.

The viewer's window is opened on a screen of its own. Needs Xvfb and the extras `view` and
`screen`.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from PIL import Image

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from iprt.viewer.viewport import Viewport
from tests.viewer.screen.x11 import Screen, xvfb

FOLDER = Path(__file__).resolve().parent
SIZE = (1280, 800)
FRAMES = 32
"""Number of frames accumulated in the picture."""
COLORS = 256


def main() -> None:
    scene = Scene.open(FOLDER.parent / "scenes360" / "room")
    entry = scene.views["room"]
    view = replace(entry.view.resized(*SIZE), yaw_deg=-4.0, pitch_deg=-27.0, fov_y_deg=62.0)
    with xvfb(*SIZE) as display:
        os.environ["DISPLAY"] = display
        from iprt.viewer.desktop.app import App  # not before it knows the display

        device = choose_device()
        engine = Engine(scene, lambda: ComputeDevice(device, limit_s=600.0))
        aside = replace(view, yaw_deg=-5.0)  # the first picture takes as long as kernels compile
        app = App(engine, Viewport(engine, aside, objects=entry.objects, frames=FRAMES))
        app.ui.selected = "pot"
        screen = Screen(display)
        screen.move(SIZE[0] - 20, SIZE[1] - 20)
        while app.ui.displayed is None or app.ui.displayed.shown.compiled:
            app.step()
        app.ui.viewport.look(view)
        while not app.ui.displayed.shown.refined:
            app.step()
        picture = Image.fromarray(screen.picture(0, 0, *SIZE))
        app.close()
        engine.close()
        screen.close()
    palette = picture.quantize(COLORS, kmeans=2)
    picture.quantize(palette=palette).save(FOLDER / "viewer.png", optimize=True)


if __name__ == "__main__":
    main()
