"""A method is a folder: without it, all that is missing is that method."""

from __future__ import annotations

import json
import os
import re
import shutil
from itertools import chain
from pathlib import Path

import pytest

from iprt.settings.methods import DEFAULT, methods
from tests.waiting import ROOT, run_python

FOLDERS = sorted(file.parent.name for file in (ROOT / "iprt" / "methods").glob("*/__init__.py"))
DELETED = {
    ("dpt", "dvct", "em", "dit", "iprt2023"): ["pt-diff", "vct", "ibl"],
    ("pt_diff", "vct", "ibl"): ["oil", "dvct", "em"],
    ("oil",): ["dpt"],
}
"""Folders that are deleted together, and methods of the same services as each of these."""
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
device = ComputeDevice(choose_device("pocl"))
objects, frame = [ball((0.2, -0.3, -1.2), 0.4, Material())], sphere_frame(2.0, 32, 16, 0.7)
told = {
    "package": str(Path(iprt.__file__).parents[1]),
    "methods": sorted(methods()),
    "covered": [],
    "radiance": [],
}
for method in sys.argv[1:]:
    picture = render(device, frame, objects, View(24, 24), Settings(method=method))
    covered = picture.aovs["coverage"] == 1.0
    told["covered"].append(int(covered.sum()))
    told["radiance"].append(float(picture.color[covered].mean()))
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


@pytest.mark.thorough
@pytest.mark.parametrize("folders", DELETED, ids="-".join)
def test_deleting_a_folder_deletes_a_method(folders: tuple[str, ...], tmp_path: Path) -> None:
    """All others are listed, and those that share services with it render."""
    skipped = shutil.ignore_patterns(*folders, "__pycache__")
    for top in ("iprt", "cl", "glsl"):
        shutil.copytree(ROOT / top, tmp_path / top, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.rmtree(tmp_path / top / "methods", ignore_errors=True)
    for top in ("iprt", "cl"):
        shutil.copytree(ROOT / top / "methods", tmp_path / top / "methods", ignore=skipped)
    code, path = ("-c", CODE, *DELETED[folders]), f"{tmp_path}{os.pathsep}{ROOT}"
    done = run_python(*code, cwd=tmp_path, PYTHONPATH=path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["package"] == str(tmp_path)
    gone = set(methods()) - set(told["methods"])
    assert {name.replace("-", "_") for name in gone} == set(folders)
    for name in gone:
        assert f"method '{name}' of iprt cannot be loaded" in done.stderr
    assert min(told["covered"]) > 50
    assert all(0.05 < radiance < 0.7 for radiance in told["radiance"])


def test_each_folder_is_deleted_once() -> None:
    assert sorted([*chain.from_iterable(DELETED), DEFAULT]) == FOLDERS
