"""`python -m tests.on_device`: it has one try, on an unknown machine."""

from __future__ import annotations

import json
import os
import sys
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.program import Program
from tests.films import planned_kernels
from tests.gpu import Need, allocated
from tests.on_device import __main__ as main
from tests.on_device import builds, conftest, drivers
from tests.on_device.frames import SHARE, difference

LOG = """
ptxas info    : 0 bytes gmem
ptxas info    : Compiling entry function 'trace_delta' for 'sm_90'
ptxas info    : Function properties for trace_delta
ptxas         .     384 bytes stack frame, 8 bytes spill stores, 12 bytes spill loads
ptxas info    : Function properties for march
ptxas         .     16 bytes stack frame, 0 bytes spill stores, 0 bytes spill loads
ptxas info    : Used 124 registers, used 0 barriers, 384 bytes cumulative stack size
ptxas info    : Compiling entry function 'composite' for 'sm_90'
ptxas info    : Function properties for composite
ptxas         .     0 bytes stack frame, 0 bytes spill stores, 0 bytes spill loads
ptxas info    : Used 31 registers, 424 bytes cmem[0]
"""


@pytest.fixture
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """Variables that are put back afterwards."""
    for name in (*drivers.OVERRIDES, "LD_LIBRARY_PATH"):
        monkeypatch.setenv(name, os.environ.get(name, ""))


@pytest.mark.usefixtures("environment")
def test_a_driver_in_some_folder_is_registered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, system = tmp_path / "lib64", tmp_path / "system"
    for made in (folder, system):
        made.mkdir()
    (system / "pocl.icd").write_text("libpocl.so.2\n")
    for name in ("libnvidia-opencl.so.580.159.04", "libnvidia-opencl.so.1", "libOpenCL.so.1"):
        (folder / name).touch()
    monkeypatch.setenv("LD_LIBRARY_PATH", str(folder))
    monkeypatch.setenv("OCL_ICD_VENDORS", str(system))
    found = drivers.libraries_in(drivers.library_folders())
    assert found["nvidia"] == folder / "libnvidia-opencl.so.1"
    drivers.register(found, tmp_path / "vendors")
    written = drivers.read_vendors(Path(os.environ["OCL_ICD_VENDORS"]))
    assert written["found-nvidia.icd"] == str(folder / "libnvidia-opencl.so.1")
    assert written["pocl.icd"] == "libpocl.so.2"
    assert str(folder) in os.environ["LD_LIBRARY_PATH"].split(os.pathsep)


def test_a_checkout_has_its_methods(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [])
    monkeypatch.setenv("PYTHONPATH", "")
    drivers.install_here(tmp_path)
    assert sys.path == [os.environ["PYTHONPATH"]] == [str(tmp_path)]
    assert {point.name for point in entry_points(group="iprt.methods")} >= {"iprt", "dpt", "ibl"}


def test_the_log_of_nvidias_driver() -> None:
    assert allocated(LOG) == {"trace_delta": Need(124, 384, 20), "composite": Need(31)}
    assert allocated("Build succeeded.") == {}


def test_programs_are_built_anew_and_kernels_named(device: ComputeDevice) -> None:
    file, _, defines, *_ = next(found for found in planned_kernels() if found.name == "composite")
    rows = builds.built(device, Program.of(file, defines))
    assert [row["kernel"] for row in rows] == ["composite"]


def test_pictures_that_differ_are_told_from_similar_ones() -> None:
    picture = np.full((96, 96, 3), 0.5, np.float32)
    other = picture.copy()
    assert difference(picture, other, 1.0)["within 2/255"] == 1.0
    other[0, :9] = 1.0  # not one in a thousand
    assert difference(picture, other, 1.0)["within 2/255"] >= SHARE
    other[0, 9] = 1.0
    assert difference(picture, other, 1.0)["within 2/255"] < SHARE


@pytest.mark.thorough
def test_the_command_measures_a_processor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Selected cases, in another process, with a row for each."""
    monkeypatch.setattr(main, "OUT", tmp_path)
    monkeypatch.setattr(conftest, "OUT", tmp_path)
    monkeypatch.setattr(main, "TESTED", ())
    monkeypatch.chdir(main.ROOT)
    for name in main.UNCACHED:
        monkeypatch.setenv(name, "")  # and is put back afterwards
    monkeypatch.setenv("IPRT_TEST_DEVICE", "pocl")
    assert main.main("-k", "test_properties or test_transfers", "-n0") == 0
    rows = [json.loads(line) for line in (tmp_path / "results.jsonl").read_text().splitlines()]
    assert [row["case"] for row in rows] == ["test_properties", *["test_transfers"] * 2]
    assert rows[1]["GB/s"] > 0.0
