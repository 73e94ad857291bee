"""The vendors folder: what goes in, and that it is written whole and once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from iprt.device import icd

SYSTEM = {"pocl.icd": "libpocl.so.2", "intel64.icd": "/opt/intel/libintelocl.so"}
OURS = Path("/venv/lib/libintelocl.so")


def test_entries_add_what_the_system_lacks() -> None:
    entries = icd.vendor_entries({"pocl.icd": "libpocl.so.2"}, OURS, icd.NVIDIA)
    assert entries == {
        "pocl.icd": "libpocl.so.2",
        "iprt-intel.icd": str(OURS),
        "iprt-nvidia.icd": "libnvidia-opencl.so.1",
    }


def test_entries_never_hold_one_driver_twice() -> None:
    system = SYSTEM | {"nvidia.icd": "libnvidia-opencl.so.1"}
    entries = icd.vendor_entries(system, OURS, icd.NVIDIA)
    assert sorted(entries) == ["iprt-intel.icd", "nvidia.icd", "pocl.icd"]


def test_entries_are_the_systems_where_nothing_is_missing() -> None:
    assert icd.vendor_entries(SYSTEM, None, None) == SYSTEM


def test_folder_round_trip_and_reuse(tmp_path: Path) -> None:
    folder = icd.write_vendors(SYSTEM, tmp_path / "new" / "cache")
    assert icd.read_vendors(folder) == SYSTEM
    before = {file: file.stat().st_mtime_ns for file in folder.iterdir()}
    assert icd.write_vendors(SYSTEM, tmp_path / "new" / "cache") == folder
    assert {file: file.stat().st_mtime_ns for file in folder.iterdir()} == before
    assert len(before) == len(SYSTEM)  # no temporary file is left


def test_different_entries_go_to_different_folders(tmp_path: Path) -> None:
    first = icd.write_vendors(SYSTEM, tmp_path)
    second = icd.write_vendors({"pocl.icd": "libpocl.so.3"}, tmp_path)
    assert first != second
    assert icd.read_vendors(first) == SYSTEM


def test_a_damaged_folder_is_repaired(tmp_path: Path) -> None:
    folder = icd.write_vendors(SYSTEM, tmp_path)
    (folder / "pocl.icd").write_bytes(b"")
    (folder / "intel64.icd").unlink()
    assert icd.read_vendors(icd.write_vendors(SYSTEM, tmp_path)) == SYSTEM


def test_unreadable_entries_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "good.icd").write_text("libgood.so\n")
    (tmp_path / "bytes.icd").write_bytes(b"\xff\xfe")
    (tmp_path / "folder.icd").mkdir()
    (tmp_path / "notes.txt").write_text("not an ICD file")
    assert icd.read_vendors(tmp_path) == {"good.icd": "libgood.so"}


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A machine whose system knows PoCL, with Intel's runtime from PyPI."""
    vendors = tmp_path / "vendors"
    vendors.mkdir()
    (vendors / "pocl.icd").write_text("libpocl.so.2\n")
    monkeypatch.setattr(icd, "SYSTEM_VENDORS", vendors)
    monkeypatch.setattr(icd, "intel_runtime", lambda: OURS)
    monkeypatch.setattr(icd, "nvidia_library", lambda: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name in icd.OVERRIDES:
        monkeypatch.setenv(name, "")  # so that it is put back afterwards
        monkeypatch.delenv(name)
    return tmp_path


def test_registering_names_a_folder_with_all_drivers(machine: Path) -> None:
    icd.register_drivers()
    folder = Path(os.environ["OCL_ICD_VENDORS"])
    assert folder.parent == machine / "cache" / "iprt"
    assert sorted(icd.read_vendors(folder).values()) == ["/venv/lib/libintelocl.so", "libpocl.so.2"]


@pytest.mark.parametrize("name", icd.OVERRIDES)
def test_the_users_folder_stands(machine: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv(name, "/mine")
    icd.register_drivers()
    assert os.environ[name] == "/mine"
    assert sum(other in os.environ for other in icd.OVERRIDES) == 1
    assert not (machine / "cache" / "iprt").exists()


def test_the_system_decides_where_nothing_can_be_written(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/none")
    icd.register_drivers()
    assert "OCL_ICD_VENDORS" not in os.environ


def test_nothing_is_registered_where_nothing_is_missing(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(icd, "intel_runtime", lambda: None)
    icd.register_drivers()
    assert "OCL_ICD_VENDORS" not in os.environ


def platforms(vendors: Path | None) -> str:
    """Platform versions that pyopencl lists in a fresh process."""
    environment = {key: value for key, value in os.environ.items() if key not in icd.OVERRIDES}
    if vendors is not None:
        environment["OCL_ICD_VENDORS"] = str(vendors)
    code = "import pyopencl as cl; print([p.version for p in cl.get_platforms()])"
    result = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    return result.stdout.strip()


def test_the_loader_reads_our_folder_instead_of_the_systems(tmp_path: Path) -> None:
    system = icd.read_vendors(icd.SYSTEM_VENDORS)
    if not system:
        pytest.skip("the system knows no OpenCL driver")
    copy = icd.write_vendors(system, tmp_path)
    without = icd.write_vendors({"none.icd": "libno-such-driver.so"}, tmp_path)
    assert platforms(copy) == platforms(None)
    assert platforms(without) != platforms(None)
