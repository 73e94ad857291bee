#!/usr/bin/env python3
"""Make the README's picture of the viewer: `python docs/viewer.py` writes docs/viewer.png.

It is what the viewer's window shows, on a screen of its own; Xvfb and the extras `view` and
`screen` are needed.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parent))

from PIL import Image

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from tests.viewer.screen.x11 import Screen, xvfb

SIZE = (1280, 800)
FRAMES = 32
COLORS = 256


def main() -> None:
    scene = Scene.open(FOLDER.parent / "scenes360" / "room")
    entry = scene.views["room"]
    with xvfb(*SIZE) as display:
        os.environ["DISPLAY"] = display
        from iprt.viewer.desktop.app import App

        engine = Engine(scene, lambda: ComputeDevice(choose_device(), limit_s=600.0))
        app = App(engine, entry.view.resized(*SIZE), objects=None, folder=FOLDER, frames=FRAMES)
        screen = Screen(display)
        screen.move(SIZE[0] - 5, SIZE[1] - 5)
        app.window.place(0, 0)
        view = app.desk.viewport.view
        app.desk.viewport.look(view)
        app.desk.selected = "pot"
        while (sight := app.desk.sight) is None or not sight.shown.refined or _late(app):
            app.step()
        for _ in range(10):
            app.step()
        picture = Image.fromarray(screen.picture(0, 0, *SIZE))
        app.close()
        engine.close()
        screen.close()
    few = picture.quantize(COLORS, dither=Image.Dither.FLOYDSTEINBERG)
    few.save(FOLDER / "viewer.png", optimize=True)


if __name__ == "__main__":
    main()
