"""A scene of a few pixels with truths, for measurements."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iprt.output.picture import write_exr
from tests.scene.files import MANIFEST, write_rgb, write_scene

OBJECT = """
[[objects]]
name = "cube"
mesh = "cube.obj"
to_world = [0.2, 0, 0, 0.0, 0, 0.2, 0, -1.1, 0, 0, 0.2, -1.5, 0, 0, 0, 1]
material = { kind = "diffuse", albedo = [0.7, 0.4, 0.2] }
"""
VIEW = """
[[views]]
name = "{name}"
size = [48, 36]
pitch_deg = -35
cuts = [[11, 8, 39, 31], [4, 4, 44, 34]]
truth = "truth.exr"
truth_background = "truth.exr"
"""


def write_tiny(folder: Path, *views: str) -> Path:
    """Equal views of a cube under random light; their truth is black until it is replaced."""
    write_scene(folder, MANIFEST + OBJECT + "".join(VIEW.format(name=name) for name in views))
    light = np.random.default_rng(2).random((32, 64, 3), np.float32) ** 4
    write_rgb(folder / "color.exr", light)
    write_exr(folder / "truth.exr", np.zeros((36, 48, 3), np.float32))
    return folder
