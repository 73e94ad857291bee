"""The recipes of docs/architecture.md, followed in a copy of the sources: a material, a pass."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tests.waiting import ROOT, run_python

MATERIAL = {
    "iprt/geometry/material.py": [
        ('"principled", "dielectric"]', '"principled", "dielectric", "charcoal"]'),
        ('if self.kind == "diffuse":', 'if self.kind in ("diffuse", "charcoal"):'),
    ],
    "cl/lib/world/material.h": [
        ("#define KIND_DIELECTRIC 4", "#define KIND_DIELECTRIC 4\n#define KIND_CHARCOAL 5"),
    ],
    "cl/lib/world/brdf.h": [
        (
            "float cos_o)\n{\n    if (is_coated(material))\n        return coat",
            "float cos_o)\n{\n    if (material.kind == KIND_CHARCOAL)\n        return 0.25f;\n"
            "    if (is_coated(material))\n        return coat",
        ),
    ],
}
"""Files -> texts and what replaces them: a matte material that reflects a quarter of its albedo."""

RENDER_MATERIALS = """
import json
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.model import Settings
from tests.rendering import render
from tests.worlds import ball, sphere_frame

device = ComputeDevice(choose_device("cpu"))
settings = Settings.model_validate({"method": "ibl", "gbuffer": "cl", "atrous": {"levels": 0}})
means = {}
for kind in ("diffuse", "charcoal"):
    object = ball((0.0, 0.0, -1.2), 0.4, Material(kind, (0.8, 0.8, 0.8)))
    frame = sphere_frame(2.0, 32, 16, 1.0)
    picture = render(device, frame, [object], View(24, 24), settings)
    means[kind] = float(picture.color[picture.aovs["coverage"] == 1.0].mean())
print(json.dumps(means))
"""


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy of all that renders."""
    for folder in ("iprt", "cl", "glsl", "tests"):
        skipped = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=skipped)
    return tmp_path


def change(sources: Path, edits: dict[str, list[tuple[str, str]]]) -> None:
    for name, pairs in edits.items():
        text = (sources / name).read_text()
        for before, after in pairs:
            assert text.count(before) == 1, (name, before)
            text = text.replace(before, after)
        (sources / name).write_text(text)


def run(sources: Path, code: str) -> dict[str, float]:
    """Run a program with these sources and return its output."""
    done = run_python("-c", code, cwd=sources, PYTHONPATH=str(sources))
    assert done.returncode == 0, done.stderr
    found: dict[str, float] = json.loads(done.stdout)
    return found


@pytest.mark.thorough
def test_a_material(sources: Path) -> None:
    change(sources, MATERIAL)
    means = run(sources, RENDER_MATERIALS)
    assert means["diffuse"] == pytest.approx(0.8, rel=1e-3)
    assert means["charcoal"] == pytest.approx(0.2, rel=1e-3)


PASS = {
    "cl/compositing/dim.cl": """
// Darkens the picture.
__kernel void dim(__global float4 *picture, __global const float *share, const int width,
                  const int height)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x < width && y < height)
        picture[y * width + x].xyz *= share[0];
}
""",
    "iprt/compositing/dim.py": '''
"""Darkens the picture."""

import numpy as np


class Dim:
    def __init__(self, device, layout):
        self._layout = layout
        share = device.upload("dim share", np.array([0.5], np.float32))
        kernel = device.kernel("compositing/dim.cl", "dim")
        self._kernel = kernel.fixed(layout.arguments(), share=share)

    def run(self, picture):
        self._kernel(self._layout.size, picture=picture)
''',
}
CALL = {
    "iprt/renderer.py": [
        ("class Renderer:", "from iprt.compositing.dim import Dim\n\n\nclass Renderer:"),
        (
            "        self.composite = Composite(",
            "        self.dim = Dim(device, self.layout)\n        self.composite = Composite(",
        ),
        (
            '        return [*passes, Pass("composite",',
            "        def dim(_):\n            self.dim.run(self.composite.picture)\n\n"
            '        last = Pass("dim", Clock.FRAME, dim, ("picture",), ("picture",))\n'
            '        return [*passes, Pass("composite",',
        ),
        ('shown, ("picture",))]', 'shown, ("picture",)), last]'),
    ],
}

RENDER_PASS = """
import json
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.memory import RenderPlan
from iprt.renderer import Renderer
from tests.worlds import sphere_frame

device, view = ComputeDevice(choose_device("cpu")), View(24, 16)
frame = sphere_frame(2.0, 32, 16, 1.0)
plan = RenderPlan.of(frame, [], view)
renderer = Renderer(device, frame, [], view)
found = {"mean": float(renderer.render().color.mean()), "planned": plan.buffers["dim share"]}
found["kernels"] = sum(one.file == "compositing/dim.cl" for one in plan.kernels)
device.finish()
found["launches"] = sum(entry.launches for entry in device.profile.passes() if entry.name == "dim")
print(json.dumps(found))
"""


@pytest.mark.thorough
def test_a_pass(sources: Path) -> None:
    """The pass appears in the picture, the profile, and the plan of kernels and memory."""
    for name, text in PASS.items():
        (sources / name).write_text(text.lstrip())
    change(sources, CALL)
    found = run(sources, RENDER_PASS)
    assert found["mean"] == pytest.approx(0.5, rel=1e-3)
    assert (found["planned"], found["kernels"], found["launches"]) == (4, 1, 1)
