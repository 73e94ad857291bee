#!/usr/bin/env python3
"""Make the picture of the web viewer in docs/viewer.md: `python docs/web.py` writes docs/web.png.

Opens `scenes360/lounge` in headless Chromium, waits until the picture is refined, and clicks the
pot.
Needs the extras `view` and `screen`, and Chromium.
"""

from __future__ import annotations

import shutil
import time
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.files.atomic import replacing
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from iprt.viewer.web.browser import Browser, Start
from iprt.viewer.web.host import Host

FOLDER = Path(__file__).resolve().parent
WINDOW = {"width": 1280, "height": 800}
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
COLORS = 256
DEADLINE_S = 600.0


def main() -> None:
    scene = Scene.open(FOLDER.parent / "scenes360" / "lounge")
    view = scene.views["lounge"].view
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    with (
        Engine(scene, lambda: ComputeDevice(choose_device())) as engine,
        Host(engine, Start(view), 0) as host,
        sync_playwright() as playwright,
    ):
        chrome = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        page = chrome.new_page(viewport=WINDOW)
        page.goto(host.url)
        # Hides viser's warning about software rendering.
        page.add_style_tag(content=".mantine-Notifications-root { display: none }")
        shot = _shot(page, host)
        chrome.close()
    image = Image.open(BytesIO(shot)).convert("RGB")
    palette = image.quantize(COLORS)
    small = image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)
    with replacing(FOLDER / "web.png") as temporary:
        small.save(temporary, format="PNG", optimize=True)


def _shot(page: Any, host: Host) -> bytes:
    end = time.monotonic() + DEADLINE_S
    while not host.browsers or not _rests(host.browsers[0]):
        if time.monotonic() > end:
            raise SystemExit("the picture does not come to rest")
        time.sleep(0.1)
    (browser,) = host.browsers
    pot = next(state for state in browser.engine.objects if state.name == "pot")
    window = browser.viewport.view
    x, y = window.project(pot.to_world[:3, 3] + (0.0, 0.07, 0.0))
    page.mouse.click(x, y)
    page.wait_for_function("__viserMutable.nodeRefFromName['/gizmo']")
    page.mouse.move(5, 5)
    time.sleep(2.0)
    shot: bytes = page.screenshot()
    return shot


def _rests(browser: Browser) -> bool:
    return browser.displayed is not None and browser.lossless and browser.displayed.shown.refined


if __name__ == "__main__":
    main()
