"""A method is a folder: without it, all that is missing is that method."""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path

import pytest

from iprt.settings.methods import DEFAULT, methods
from tests.waiting import ROOT, run_python

FOLDERS = sorted(file.parent.name for file in (ROOT / "iprt" / "methods").glob("*/__init__.py"))
KIN = {"dpt": "pt-diff", "pt_diff": "oil", "oil": "dpt", "vct": "dvct", "dvct": "vct", "ibl": "em"}
"""Methods of the same services; the others stand beside `ibl`."""
CODE = """
import json, sys
from pathlib import Path
import iprt
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.methods import methods
from iprt.settings.model import Settings
from tests.rendering import render
from tests.worlds import ball, sphere_frame
device, settings = ComputeDevice(choose_device("pocl")), Settings(method=sys.argv[1])
objects, frame = [ball((0.2, -0.3, -1.2), 0.4, Material())], sphere_frame(2.0, 32, 16, 0.7)
picture = render(device, frame, objects, View(24, 24), settings)
covered = picture.aovs["coverage"] == 1.0
told = {
    "package": str(Path(iprt.__file__).parents[1]),
    "methods": sorted(methods()),
    "covered": int(covered.sum()),
    "radiance": float(picture.color[covered].mean()),
}
print(json.dumps(told))
"""


def test_each_method_has_its_folder() -> None:
    """The folder has the method's name, without the hyphen, which no module may have."""
    assert sorted(name.replace("-", "_") for name in methods()) == FOLDERS
    for kernels in (ROOT / "cl" / "methods").iterdir():
        assert kernels.name in FOLDERS
    for tests in (ROOT / "tests" / "methods").glob("*/__init__.py"):
        assert tests.parent.name in FOLDERS


@pytest.mark.parametrize("folder", FOLDERS)
def test_nothing_else_names_a_method_s_folder(folder: str) -> None:
    """Modules, kernels and tests of other folders do not name it."""
    named = re.compile(rf"\bmethods[./]{folder}[./\"]|\bmethods\.{folder} import")
    knows = []
    for top, suffixes in (("iprt", (".py",)), ("cl", (".cl", ".h")), ("tests", (".py",))):
        for file in sorted((ROOT / top).rglob("*.*")):
            own = file.is_relative_to(ROOT / top / "methods" / folder)
            if not own and file.suffix in suffixes and named.search(file.read_text("utf-8")):
                knows.append(str(file.relative_to(ROOT)))
    assert not knows


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of iprt, which Python compiles once."""
    copy = tmp_path_factory.mktemp("package")
    for top in ("iprt", "cl", "glsl"):
        shutil.copytree(ROOT / top, copy / top, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.mark.thorough
@pytest.mark.parametrize("folder", [name for name in FOLDERS if name != DEFAULT])
def test_deleting_a_folder_deletes_a_method(folder: str, package: Path) -> None:
    """All others are listed, and one that shares services with it, if any, renders."""
    skipped = shutil.ignore_patterns(folder, "__pycache__")
    for parent in (package / "iprt", package / "cl"):
        shutil.rmtree(parent / "methods", ignore_errors=True)
        shutil.copytree(ROOT / parent.name / "methods", parent / "methods", ignore=skipped)
    code, path = ("-c", CODE, KIN.get(folder, "ibl")), f"{package}{os.pathsep}{ROOT}"
    done = run_python(*code, cwd=package, PYTHONPATH=path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["package"] == str(package)
    (gone,) = set(methods()) - set(told["methods"])
    assert gone.replace("-", "_") == folder
    assert f"method '{gone}' of iprt cannot be loaded" in done.stderr
    assert told["covered"] > 50
    assert 0.05 < told["radiance"] < 0.7
