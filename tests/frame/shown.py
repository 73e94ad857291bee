"""Pictures that must look alike on every OpenCL driver.

Two drivers that bring an LLVM each may crash one another, so that a process uses one of them only:
`python -m tests.frame.shown CASE FILE` writes those of PoCL.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.device.icd import OVERRIDES
from iprt.errors import DeviceError
from iprt.footage.prepare.stages import Preparation
from iprt.geometry.camera import View
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.methods import DEFAULT, methods
from iprt.settings.model import Settings
from tests.frame.test_determinism import video, walk
from tests.frame.whole_frame import METHODS, still_life
from tests.waiting import DEADLINE_S

ROOT = Path(__file__).resolve().parents[2]
SIZE = 96
FEW = {"irradiance": {"rows": 32}, "iprt": {"ratio_rows": 16}}
WALKS = {"-".join(method): method for method in METHODS}
SCENES = ("chart", "room", "train")
CASES = (*WALKS, *SCENES, *(name for name in methods() if name != DEFAULT))
"""Walks by two methods over a video, and a still of each scene and by each other method."""

Pictures = list[NDArray[np.float32]]


def shown(device: ComputeDevice, case: str) -> Pictures:
    """The pictures (H, W, 3) of one of `CASES`, linear."""
    if case in WALKS:
        view = View(128, SIZE, pitch_deg=-35.0)
        return [picture.color for picture in walk(device, WALKS[case], view)]
    return list(_scene(device, case) if case in SCENES else _method(device, case))


def shown_elsewhere(case: str, folder: Path) -> Pictures | None:
    """Return PoCL's pictures, made in another process by way of a file in `folder`.

    None: PoCL is not installed.
    """
    file = folder / f"{case}.npz"
    usual = {name: value for name, value in os.environ.items() if name not in OVERRIDES}
    child = subprocess.run(
        [sys.executable, "-m", "tests.frame.shown", case, str(file)],
        cwd=ROOT,
        env=usual,
        capture_output=True,
        text=True,
        check=False,
        timeout=DEADLINE_S,
    )
    if child.returncode == DeviceError.exit_code:
        return None
    assert child.returncode == 0, child.stderr
    with np.load(file) as arrays:
        return list(arrays.values())


def _scene(device: ComputeDevice, name: str) -> Iterator[NDArray[np.float32]]:
    scene = Scene.open(ROOT / "scenes360" / name)
    # What is glossy is declared: looking for more takes longer than all else.
    frame = Preparation(materials=scene.declared_materials)(scene.raw_frame())
    view, instances = next(iter(scene.views.values())).view, scene.instances
    view = replace(view, width=SIZE, height=SIZE)
    with Renderer(device, frame, instances, view, Settings.model_validate(FEW)) as renderer:
        yield renderer.render(2).color


def _method(device: ComputeDevice, name: str) -> Iterator[NDArray[np.float32]]:
    settings = Settings.model_validate({"method": name, **FEW})
    view = View(SIZE, SIZE, pitch_deg=-35.0)
    with Renderer(device, video()[0], still_life(), view, settings) as renderer:
        yield renderer.render(2).color


def main(case: str, file: str) -> int:
    """Write the pictures of a case; the exit status."""
    try:
        device = choose_device("pocl")
    except DeviceError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    np.savez(file, *shown(ComputeDevice(device), case))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
