"""The wheel's contents, and the two commands that set everything up."""

from __future__ import annotations

import os
import shutil
import subprocess
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

import iprt
from tests.waiting import DEADLINE_S, ROOT, run_python

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
INCLUDED = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]


def test_kernels_and_shaders_are_found_as_the_wheel_lays_them_out(tmp_path: Path) -> None:
    """`iprt.files.resources` in a folder made by the wheel's rules, far from the checkout."""
    (tmp_path / "iprt" / "files").mkdir(parents=True)
    for name in ("__init__.py", "files/__init__.py", "files/resources.py"):
        shutil.copy(ROOT / "iprt" / name, tmp_path / "iprt" / name)
    for source, target in INCLUDED.items():
        shutil.copytree(ROOT / source, tmp_path / target)
    code = "from iprt.files.resources import CL, GLSL; print(CL, GLSL, sep='\\n')"
    found = run_python("-c", code, cwd=tmp_path).stdout.splitlines()
    for folder, name in zip(found, ("cl", "glsl"), strict=True):
        assert Path(folder).is_relative_to(tmp_path)
        packed = {path.relative_to(folder) for path in Path(folder).rglob("*.*")}
        kept = {path.relative_to(ROOT / name) for path in (ROOT / name).rglob("*.*")}
        assert packed == kept
        assert kept


def test_project_names_files_that_exist() -> None:
    assert (ROOT / PROJECT["project"]["readme"]).is_file()
    module, _, function = PROJECT["project"]["scripts"]["iprt"].partition(":")
    assert callable(getattr(import_module(module), function))
    assert (
        f'__version__ = "{iprt.__version__}"'
        in (ROOT / PROJECT["tool"]["hatch"]["version"]["path"]).read_text()
    )


@pytest.mark.parametrize("script", ["run", ".ci/run"])
def test_scripts_are_valid_and_executable(script: str) -> None:
    assert os.access(ROOT / script, os.X_OK)
    subprocess.run(["bash", "-n", str(ROOT / script)], check=True)


def test_run_without_a_word_explains_itself() -> None:
    result = subprocess.run(
        [str(ROOT / "run")], capture_output=True, text=True, check=False, timeout=DEADLINE_S
    )
    assert result.returncode == 2
    assert "./run demo" in result.stderr
    assert "./run test" in result.stderr


def test_public_names_are_there_and_cost_nothing_until_used() -> None:
    for name in iprt.__all__:
        assert getattr(iprt, name).__class__ is not None
        assert name in dir(iprt)
    with pytest.raises(AttributeError, match="no attribute 'Rendrer'"):
        _ = iprt.Rendrer  # type: ignore[attr-defined]
    code = "import iprt, sys; print(*sys.modules)"
    loaded = run_python("-c", code).stdout.split()
    assert not {"numpy", "pyopencl", "iprt.renderer"} & set(loaded)
