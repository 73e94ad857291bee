"""A frame of each scene, and one by each method, against the pictures that PoCL rendered elsewhere.

Kernels are those of a GPU on any device, and rays find the objects: only drivers differ.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.film import footage_of
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.output.display import display
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.methods import DEFAULT, methods
from iprt.settings.model import Settings
from tests.like_gpu import LikeGpu
from tests.on_device.conftest import ROOT

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
"""Largest difference of displayed pictures in this share of the pixels, as of two drivers on
processors: rounding differs, so that a few rays hit something else
(`tests/frame/test_devices_agree.py`)."""


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
    """List the names of this repository's scenes."""
    return sorted(file.parent.name for file in ROOT.glob("scenes360/*/scene.toml"))


@cache
def opened(scene: str) -> Scene:
    """Open a scene by name."""
    return Scene.open(ROOT / "scenes360" / scene)


@cache
def first_frame(scene: str) -> Frame:
    """Read the first frame of a scene, which takes seconds."""
    return opened(scene).frame()


def shots() -> list[Shot]:
    """List every scene by the default method, a panorama, and every other method."""
    views = {scene: next(iter(opened(scene).views)) for scene in scenes()}
    default = [Shot(scene, view, DEFAULT) for scene, view in views.items()]
    around = Shot(MANY, "equirect", DEFAULT)
    others = [Shot(MANY, views[MANY], method) for method in methods() if method != DEFAULT]
    return [*default, around, *others]


def rendered(device: LikeGpu, shot: Shot) -> NDArray[np.float32]:
    """Render linear radiance (H, W, 3)."""
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
    """Hash the files that pictures depend on."""
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
        pictures[shot.name] = rendered(device, shot).astype(np.float16)
        print(shot.name)
        np.savez_compressed(path, **pictures)
    print(f"{path}: {path.stat().st_size >> 10} KiB")


@pytest.fixture(scope="module")
def reference() -> dict[str, NDArray[Any]]:
    if not REFERENCE.is_file():
        pytest.skip(MISSING)
    with np.load(REFERENCE) as file:
        return dict(file)


def test_the_reference_is_of_this_code(reference: dict[str, NDArray[Any]]) -> None:
    assert str(reference[CODE]) == code()


@pytest.mark.parametrize("shot", shots(), ids=lambda shot: shot.name)
def test_a_picture_agrees_with_pocl(
    shot: Shot,
    reference: dict[str, NDArray[Any]],
    device: ComputeDevice,
    tell: Callable[..., None],
) -> None:
    picture = rendered(LikeGpu(device.device), shot)
    assert np.isfinite(picture).all()
    wanted = reference[shot.name].astype(np.float32)
    figures = difference(picture, wanted, opened(shot.scene).exposure)
    tell(**figures)
    assert figures["within 2/255"] >= SHARE


def difference(picture: NDArray[Any], wanted: NDArray[Any], exposure: float) -> dict[str, float]:
    """Compare two pictures as displayed, in steps of 8 bits."""
    apart = np.abs(display(picture, exposure) - display(wanted, exposure)).max(-1)
    return {
        "most /255": 255.0 * float(apart.max()),
        "99.9% /255": 255.0 * float(np.quantile(apart, SHARE)),
        "mean /255": 255.0 * float(apart.mean()),
        "within 2/255": float((apart <= LEVELS).mean()),
    }
