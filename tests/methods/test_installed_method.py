"""The package of docs/adding-a-method.md adds a method: from the command line to the picture."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from iprt.scene.scene import Scene
from iprt.settings.methods import methods

PAGE = Path(__file__).parents[2] / "docs" / "adding-a-method.md"
FILE = re.compile(r"^`([^`]+)`:\n\n```[a-z]+\n(.*?)^```", re.MULTILINE | re.DOTALL)


def wheel_of(page: str) -> dict[str, str]:
    """The files of the package of a page, as they are in its wheel."""
    files = dict(FILE.findall(page))
    project = tomllib.loads(files.pop("pyproject.toml"))["project"]
    name, version = project["name"], project["version"]
    (points,) = project["entry-points"].items()
    lines = [f"[{points[0]}]", *(f"{key} = {value}" for key, value in points[1].items())]
    wheel = ["Wheel-Version: 1.0", "Root-Is-Purelib: true", "Tag: py3-none-any"]
    metadata = ["Metadata-Version: 2.1", f"Name: {name}", f"Version: {version}"]
    told = {"METADATA": metadata, "WHEEL": wheel, "entry_points.txt": lines, "RECORD": []}
    about = {f"{name}-{version}.dist-info/{key}": "\n".join(text) for key, text in told.items()}
    return {**files, **about}


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of an environment that sees this one's packages, and has the method."""
    folder = tmp_path_factory.mktemp("environment")
    wheel = folder / "uniform-1-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in wheel_of(PAGE.read_text("utf-8")).items():
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


@pytest.mark.thorough
def test_an_installed_method_renders(python: Path, scene: Path, tmp_path: Path) -> None:
    """In the light of the mean radiance, an object has its albedo's part of that."""
    listed = json.loads(iprt(python, "methods", "--json"))
    assert sorted(listed) == sorted([*methods(), "uniform"])
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
