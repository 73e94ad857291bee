"""`python -m tests.on_device`: it has one try, on a machine that we do not know."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.program import Program
from tests.films import planned_kernels
from tests.gpu import Need, allocated
from tests.on_device import builds, drivers, packages, suite
from tests.on_device.frames import difference
from tests.on_device.results import Results
from tests.on_device.runner import ROOT, Step, run
from tests.waiting import DEADLINE_S, until

CASES = "tests.device.cases_that_fail"
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


# Running ------------------------------------------------------------------------------------


def played(folder: Path, names: str, *, case_s: float = DEADLINE_S) -> Results:
    """Results of a step with the cases of these names."""
    step = Step("step", "A step", CASES, 1.0, case_s)
    results = Results(folder, [step])
    run(
        step,
        results.outcomes["step"],
        device=names,
        until=time.monotonic() + DEADLINE_S,
        folder=folder,
        ended=lambda case: results.ended(step, case),
    )
    results.write()
    return results


def test_a_crash_and_an_exception_end_one_case_each(tmp_path: Path) -> None:
    outcome = played(tmp_path, "crashes,well,raises,also well").outcomes["step"]
    assert outcome.finished
    assert list(outcome.done) == ["crashes", "well", "raises", "also well"]
    assert outcome.done["crashes"] == {"problem": "the process was ended by SIGSEGV"}
    assert outcome.done["raises"] == {"problem": "RuntimeError: out of resources"}
    for name in ("well", "also well"):
        assert outcome.rows(name) == [{"ms": 1.5, "passes": {"temporal": 0.5}}]
    page = (tmp_path / "results.md").read_text()
    assert "| also well | 1.5 |" in page
    assert "- failed: crashes: the process was ended by SIGSEGV" in page
    assert "did not fit" not in page
    assert "Traceback" in (tmp_path / "log.txt").read_text()


def test_a_hang_ends_one_case(tmp_path: Path) -> None:
    outcome = played(tmp_path, "hangs", case_s=0.2).outcomes["step"]
    assert outcome.done == {"hangs": {"problem": "no answer within 0 s"}}


def test_a_step_that_cannot_begin_says_why(tmp_path: Path) -> None:
    outcome = played(tmp_path, "no such case").outcomes["step"]
    assert outcome.failed == "KeyError: 'no such case'"
    assert "KeyError" in (tmp_path / "results.md").read_text()


def test_what_did_not_fit_is_said(tmp_path: Path) -> None:
    step = Step("step", "A step", CASES, 1.0)
    results = Results(tmp_path, [step])
    outcome = results.outcomes["step"]
    outcome.cases, outcome.done = ["well", "hangs"], {"well": {"rows": []}}
    results.write()
    assert "did not fit into the time: hangs" in (tmp_path / "results.md").read_text()
    assert json.loads((tmp_path / "results.json").read_text())["steps"]["step"]["left"] == ["hangs"]


@pytest.mark.thorough
def test_results_stay_when_it_is_cut_off(tmp_path: Path) -> None:
    code = (
        "import signal; from pathlib import Path; from tests.on_device import __main__ as main;"
        "from tests.device.test_on_device import played; signal.signal(15, main._interrupt);"
        f"played(Path({str(tmp_path)!r}), 'well,hangs')"
    )
    process = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stderr=subprocess.DEVNULL)
    file = tmp_path / "results.json"
    until(lambda: file.exists() and bool(json.loads(file.read_text())["steps"]["step"]["cases"]))
    child = children(process.pid)[0]
    process.send_signal(signal.SIGTERM)
    assert process.wait(DEADLINE_S) != 0
    assert list(json.loads(file.read_text())["steps"]["step"]["cases"]) == ["well"]
    assert "| well | 1.5 |" in (tmp_path / "results.md").read_text()
    until(lambda: not Path("/proc", str(child)).exists())


def children(process: int) -> list[int]:
    """Processes that it has started."""
    return [int(n) for n in Path(f"/proc/{process}/task/{process}/children").read_text().split()]


# Drivers and packages -----------------------------------------------------------------------


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


def test_missing_and_old_packages_are_named() -> None:
    assert packages.missing(["numpy>=1.0", "no-such-package>=2", "numpy>=9999"]) == [
        "no-such-package>=2",
        "numpy>=9999",
    ]
    assert "'no-such-package>=2'" in packages.advice(["no-such-package>=2"])


def test_a_checkout_has_its_methods(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    packages.install_here(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    assert {point.name for point in entry_points(group="iprt.methods")} >= {"iprt", "dpt", "ibl"}


# What steps say -----------------------------------------------------------------------------


def test_the_log_of_nvidias_driver() -> None:
    assert allocated(LOG) == {"trace_delta": Need(124, 384, 20), "composite": Need(31)}
    assert allocated("Build succeeded.") == {}


def test_programs_are_built_anew_and_kernels_named(device: ComputeDevice) -> None:
    file, _, defines, *_ = next(found for found in planned_kernels() if found.name == "composite")
    rows = builds.built(device, Program.of(file, defines))
    assert [row["kernel"] for row in rows] == ["composite"]


def test_pictures_that_differ_are_told_from_those_that_hardly_do() -> None:
    picture = np.full((96, 96, 3), 0.5, np.float32)
    other = picture.copy()
    assert difference(picture, other, 1.0)["verdict"] == "agrees"
    other[0, :9] = 1.0  # not one in a thousand
    assert difference(picture, other, 1.0)["verdict"] == "agrees"
    other[0, 9] = 1.0
    assert difference(picture, other, 1.0)["verdict"] == "DIFFERS"
    other[0, 0] = np.nan
    assert difference(other, picture, 1.0)["verdict"] == "NOT FINITE"


PLAIN = """
tests/a.py::b[x y] PASSED                 [ 33%]
tests/a.py::c FAILED                      [ 66%]
tests/a.py::d SKIPPED (no driver)         [100%]
"""
PARALLEL = """
[gw0] [ 33%] PASSED tests/a.py::b[x y] 
[gw1] [ 66%] FAILED tests/a.py::c 
[gw0] [100%] SKIPPED tests/a.py::d 
"""  # noqa: W291


@pytest.mark.parametrize("told", [PLAIN, PARALLEL])
def test_what_pytest_says_is_added_up(told: str) -> None:
    counts = {"passed": 1, "failed": 1, "error": 0, "skipped": 1}
    end = "= short test summary info =\nFAILED tests/a.py::c - assert 1 == 2\n"
    assert suite.summary(told + end, cut=False) == [
        counts,
        {"failure": "tests/a.py::c: assert 1 == 2"},
    ]
    assert suite.summary(told, cut=True) == [
        {**counts, "failure": "time was up before the last test"},
        {"failure": "tests/a.py::c: no reason was told"},
    ]
    assert suite.summary("gone\n", cut=False)[0]["failure"] == "pytest ended early: gone"
