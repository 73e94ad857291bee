"""A frame of each scene, and one by each method, beside the same that PoCL rendered elsewhere.

Kernels are those of a GPU on any device, and rays find the objects: only drivers differ.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.device.choose import choose_device
from iprt.film import footage_of
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.output.display import display
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.methods import DEFAULT, methods
from iprt.settings.model import Settings
from tests.like_gpu import LikeGpu
from tests.on_device.cases import Asked, Cases, Row
from tests.on_device.results import say

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "out" / "on_device_frames.npz"
"""Pictures by case, and the code that made them."""
MISSING = (
    f"no {REFERENCE.relative_to(ROOT)}: make it by `python -m tests.on_device --reference` where "
    "there is PoCL, and take it along"
)
CODE = "code"
MANY = "room"
"""The scene that all methods show."""
SIDE, FRAMES = 96, 4
LEVELS, SHARE = 2.0 / 255.0, 0.999
"""What is shown may differ by so much, in this share of the pixels, as two drivers on processors
do: rounding differs, so that a few rays meet something else (`tests/frame/test_devices_agree.py`).
"""


@dataclass(frozen=True)
class Shot:
    """A picture.

    Attributes
    ----------
    view : str
        Name of a view of the scene, or "equirect".
    """

    scene: str
    view: str
    method: str

    @property
    def name(self) -> str:
        return f"{self.scene} {self.view}, {self.method}"


def scenes() -> list[str]:
    """Names of this repository's."""
    return sorted(file.parent.name for file in ROOT.glob("scenes360/*/scene.toml"))


@cache
def opened(scene: str) -> Scene:
    """One of them."""
    return Scene.open(ROOT / "scenes360" / scene)


@cache
def first_frame(scene: str) -> Frame:
    """Of its video; it takes seconds."""
    return opened(scene).frame()


def shots() -> list[Shot]:
    """All of them: every scene by the default method, a panorama, and every other method."""
    views = {scene: next(iter(opened(scene).views)) for scene in scenes()}
    default = [Shot(scene, view, DEFAULT) for scene, view in views.items()]
    around = Shot(MANY, "equirect", DEFAULT)
    others = [Shot(MANY, views[MANY], method) for method in methods() if method != DEFAULT]
    return [*default, around, *others]


def rendered(device: LikeGpu, shot: Shot) -> NDArray[np.float32]:
    """(H, W, 3) linear radiance."""
    scene, frame = opened(shot.scene), first_frame(shot.scene)
    settings = Settings.model_validate({"method": shot.method, "gbuffer": "cl", "fading": 0.0})
    if shot.view == "equirect":
        view, objects = View(2 * SIDE, SIDE, projection="equirect"), scene.instances
    else:
        own = scene.views[shot.view]
        view = replace(own.view, width=SIDE, height=SIDE)
        objects = scene.instances_named(own.objects)
    footage = footage_of(scene, frame, settings)
    with Renderer(device, frame, objects, view, settings, footage=footage) as renderer:
        return renderer.render(FRAMES).color


def code() -> str:
    """A hash of what pictures depend on."""
    found = hashlib.sha256()
    for pattern in ("cl/**/*.*", "glsl/*", "iprt/**/*.py", "scenes360/*/*.*"):
        for file in sorted(ROOT.glob(pattern)):
            if file.is_file():
                found.update(file.read_bytes())
    return found.hexdigest()


def write_reference(path: Path = REFERENCE) -> None:
    """Render all shots on PoCL."""
    device = LikeGpu(choose_device("pocl"))
    path.parent.mkdir(parents=True, exist_ok=True)
    pictures: dict[str, NDArray[Any]] = {CODE: np.array(code())}
    for shot in shots():
        start = time.perf_counter()
        pictures[shot.name] = rendered(device, shot).astype(np.float16)
        say(f"{shot.name}: {time.perf_counter() - start:.1f} s")
        np.savez_compressed(path, **pictures)
    say(f"{path}: {path.stat().st_size >> 10} KiB")


def cases(asked: Asked) -> Cases:
    """One for each shot, after one that says whether the reference is of this code."""
    held: dict[str, NDArray[Any]] = {}
    if REFERENCE.is_file():
        with np.load(REFERENCE) as file:
            held = dict(file)
    device = cache(lambda: LikeGpu(choose_device(asked.device)))

    def reference() -> list[Row]:
        if not held:
            return [{"verdict": MISSING}]
        same = str(held[CODE]) == code()
        return [{"verdict": "of this code" if same else "OF OTHER CODE: differences may be its"}]

    return {"reference": reference} | dict(_compared(held, device))


def _compared(
    held: dict[str, NDArray[Any]], device: Callable[[], LikeGpu]
) -> Iterator[tuple[str, Callable[[], list[Row]]]]:
    for shot in shots():

        def compare(shot: Shot = shot) -> list[Row]:
            start = time.perf_counter()
            picture = rendered(device(), shot)
            seconds = time.perf_counter() - start
            if shot.name not in held:
                finite = "finite" if np.isfinite(picture).all() else "NOT FINITE"
                return [{"verdict": f"{finite}, not in the reference", "s": seconds}]
            wanted = held[shot.name].astype(np.float32)
            return [{**difference(picture, wanted, opened(shot.scene).exposure), "s": seconds}]

        yield shot.name, compare


def difference(picture: NDArray[Any], wanted: NDArray[Any], exposure: float) -> Row:
    """How far apart two pictures are as they are shown, in steps of 8 bits."""
    if not np.isfinite(picture).all():
        return {"verdict": "NOT FINITE"}
    apart = np.abs(display(picture, exposure) - display(wanted, exposure)).max(-1)
    share = float((apart <= LEVELS).mean())
    return {
        "verdict": "agrees" if share >= SHARE else "DIFFERS",
        "most /255": 255.0 * float(apart.max()),
        "99.9% /255": 255.0 * float(np.quantile(apart, SHARE)),
        "mean /255": 255.0 * float(apart.mean()),
        "within 2/255 %": 100.0 * share,
    }
