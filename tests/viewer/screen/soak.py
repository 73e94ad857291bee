"""Random use of the desktop viewer, with its memory: `python -m tests.viewer.screen.soak`.

One who hits keys, drags, clicks into panels and plays the video at random, with a fixed seed.
Prints the resident memory each minute. Fails on a defect, or above `LIMIT_GB`.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tyro

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.scene.scene import Scene
from iprt.viewer.engine import Engine
from iprt.viewer.viewport import Viewport
from tests.viewer.screen.x11 import Screen, xvfb
from tests.waiting import ROOT

SIZE = (1280, 800)
LIMIT_GB = 1.5
"""Resident memory to stay below; docs/viewer.md has the present figures."""
KEYS = (
    [
        "t",
        "r",
        "s",
        "n",
        "x",
        "c",
        "b",
        "f",
        "0",
        "e",
        "k",
        "h",
        "v",
        "i",
        "p",
        "l",
        "space",
        "Left",
        "Right",
        "End",
        "F2",
        "question",
        "Escape",
        "Delete",
    ],
    ["z", "y", "d", "a", "g", "c", "v", "b"],
)
"""Keys without and with Ctrl. None closes the window, or writes a file."""


def main(scene: str = "lounge", minutes: float = 30.0, seed: int = 0) -> int:
    """Use a copy of a scene of scenes360/ for some minutes."""
    with tempfile.TemporaryDirectory() as folder, xvfb(*SIZE) as display:
        os.environ["DISPLAY"] = display
        os.environ["XDG_PICTURES_DIR"] = folder
        copy = Path(folder) / scene
        shutil.copytree(ROOT / "scenes360" / scene, copy)
        return _use(Scene.open(copy), Screen(display), 60.0 * minutes, seed)


def _use(scene: Scene, screen: Screen, seconds: float, seed: int) -> int:
    from iprt.viewer.desktop.app import App  # not before it knows the display

    random, most = np.random.default_rng(seed), 0.0
    view = next(iter(scene.views.values())).view.resized(*SIZE)
    device = choose_device()
    with Engine(scene, lambda: ComputeDevice(device, 60.0)) as engine:
        app = App(engine, Viewport(engine, view, target_fps=10.0))
        screen.focus()
        begin = minute = time.monotonic()
        done: dict[str, int] = {}
        while (now := time.monotonic()) < begin + seconds:
            act = _actions(screen, random)[random.integers(6)]
            act()
            done[act.__name__] = done.get(act.__name__, 0) + 1
            for _ in range(int(random.integers(2, 30))):
                app.step()
            if defects := [p for p in engine.status.problems if "defect" in p]:
                print(f"{defects[0]}\nafter {done}")
                return 1
            memory = _resident_gb()
            most = max(most, memory)
            if now > minute:
                minute += 60.0
                objects = len(engine.objects)
                print(
                    f"{(now - begin) / 60.0:5.1f} min {memory:.2f} GB, {objects} objects",
                    flush=True,
                )
        app.close()
    screen.close()
    print(f"most: {most:.2f} GB; {done}")
    return int(most > LIMIT_GB)


def _resident_gb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e9


def _actions(screen: Screen, random: np.random.Generator) -> tuple[Callable[[], None], ...]:
    def place(low: float = 0.0, high: float = 1.0) -> tuple[float, float]:
        x, y = random.uniform((low, 0.05), (high, 0.95))
        return float(x * SIZE[0]), float(y * SIZE[1])

    def key() -> None:
        screen.key(str(random.choice(KEYS[0])))

    def control_key() -> None:
        screen.key(str(random.choice(KEYS[1])), control=True)

    def click(low: float = 0.0, high: float = 0.71) -> None:
        screen.move(*place(low, high))
        screen.button(1, down=True)
        screen.button(1, down=False)

    def panel() -> None:
        click(0.73, 0.98)

    def drag() -> None:
        screen.move(*place(0.0, 0.71))
        screen.button(1, down=True)
        for _ in range(6):
            screen.move(*place(0.0, 0.71))
        screen.button(1, down=False)

    def wheel() -> None:
        screen.move(*place())
        screen.wheel(int(random.integers(-3, 4)))

    return key, control_key, click, panel, drag, wheel


if __name__ == "__main__":
    sys.exit(tyro.cli(main))
