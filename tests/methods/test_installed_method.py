"""A package adds a method by being installed: from the command line to the picture."""

from __future__ import annotations

import json
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from iprt.scene.scene import Scene

PACKAGE = {
    "uniform/__init__.py": '''
from pydantic import Field
from iprt.settings.methods import MethodInfo, MethodSettings, Needs


class UniformSettings(MethodSettings):
    """Light that comes from all sides alike."""

    strength: float = Field(default=1.0, ge=0.0, le=10.0, description="Factor of the light.")


METHOD = MethodInfo(
    "uniform",
    "The mean of the panorama from all sides",
    "uniform.method:Uniform",
    paper="Nobody, Nothing, 2026",
    settings=UniformSettings,
    needs=lambda settings: Needs(),
    defaults={"atrous.levels": 2},
)
''',
    "uniform/method.py": """
from pathlib import Path
from iprt.gbuffer.guide import plane_defines
from iprt.methods.protocol import Method, Signals
from uniform import UniformSettings


class Uniform(Method):
    def __init__(self, setup):
        super().__init__(setup)
        self.light = setup.device.zeros("uniform light", setup.layout.shape(3))
        self.kernel = setup.device.kernel(
            str(Path(__file__).with_name("fill.cl")), "fill", plane_defines()
        )
        self.objects = 0

    def prepare_video(self, world):
        strength = self.setup.features.settings.own(UniformSettings).strength
        self.value = strength * world.panorama.mean_radiance

    def prepare_objects(self, world):
        self.objects += 1

    def trace(self, world, context):
        assert self.objects == 1, "nothing moves in a still picture"
        layout = self.setup.layout
        self.kernel(
            layout.size, light=self.light, value=self.value, width=layout.width,
            height=layout.height,
        )
        return Signals(diffuse=self.light)
""",
    "uniform/fill.cl": """
#include "gbuffer/planes.h"

__kernel void fill(__global float *light, const float value, const int width, const int height)
{
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    store_planes(light, plane_size(width, height), plane_index(x, y, width), (float3)(value));
}
""",
    "uniform-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: uniform\nVersion: 1\n",
    "uniform-1.dist-info/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    "uniform-1.dist-info/entry_points.txt": "[iprt.methods]\nuniform = uniform:METHOD\n",
    "uniform-1.dist-info/RECORD": "",
}


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of an environment that sees this one's packages, and has the method."""
    folder = tmp_path_factory.mktemp("environment")
    wheel = folder / "uniform-1-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in PACKAGE.items():
            archive.writestr(name, text)
    venv.create(folder / "env", with_pip=False)
    python = folder / "env" / "bin" / "python"
    (packages,) = (folder / "env").glob("lib/python*/site-packages")
    here = sysconfig.get_path("purelib")
    (packages / "here.pth").write_text(f"import site; site.addsitedir({here!r})\n")
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-index"]
    subprocess.run([*pip, "--no-deps", "-qq", str(wheel)], check=True)
    return python


def iprt(python: Path, *words: object) -> str:
    done = subprocess.run(
        [str(python), "-m", "iprt", *map(str, words)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def channels(file: Path) -> dict[str, NDArray[np.float64]]:
    with OpenEXR.File(str(file), separate_channels=True) as opened:
        return {name: c.pixels.astype(np.float64) for name, c in opened.channels().items()}


def test_an_installed_method_renders(python: Path, scene: Path, tmp_path: Path) -> None:
    """In the light of the mean radiance, an object has its albedo's part of that."""
    listed = json.loads(iprt(python, "methods", "--json"))
    assert list(listed) == ["iprt", "em", "ibl", "iprt2023", "uniform"]
    assert listed["uniform"]["settings"] == {"uniform.strength": 1.0}
    assert "The mean of the panorama" in iprt(python, "methods")
    pictures = {}
    for strength in (1.0, 2.0):
        file = tmp_path / f"{strength}.exr"
        iprt(
            python, "render", scene, "-o", file, "--method", "uniform", "--accumulate", 2,
            "--size", 48, 36, "--set", f"uniform.strength={strength}", "--aov", "albedo",
            "--aov", "coverage", "--device", "cpu",
        )  # fmt: skip
        pictures[strength] = channels(file)
    frame = Scene.open(scene).frame()
    rows = np.sin((np.arange(frame.height) + 0.5) / frame.height * np.pi)
    mean = np.average(frame.radiance.mean(axis=(1, 2)), weights=rows)
    for strength, found in pictures.items():
        solid = found["coverage.A"] == 1.0
        assert solid.sum() > 50
        for name in "RGB":
            expected = strength * mean * found[f"albedo.{name}"][solid]
            np.testing.assert_allclose(found[name][solid], expected, rtol=2e-3)


def test_a_broken_method_is_left_out(python: Path) -> None:
    """With a warning that names it; the others work."""
    code = (
        "import sys; sys.modules['uniform'] = None; import iprt.cli; iprt.cli.command(['methods'])"
    )
    done = subprocess.run([str(python), "-c", code], capture_output=True, text=True, check=True)
    assert "method 'uniform' of uniform cannot be loaded" in done.stderr
    assert "uniform" not in done.stdout
    assert "iprt2023" in done.stdout
