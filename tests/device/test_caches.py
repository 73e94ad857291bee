"""Caches of compiled kernels that cannot be written, are full, or are no folders."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from iprt.device import caches
from iprt.device.caches import Caches, folder_problem, require_caches, settle_caches
from iprt.device.choose import describe_devices
from iprt.errors import DeviceError

ROOT = Path(__file__).parents[2]
NOBODY = 65534
VARIABLES = ("XDG_CACHE_HOME", "POCL_CACHE_DIR")


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """That of a user with a home folder; whatever is settled is forgotten afterwards."""
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in VARIABLES:
        monkeypatch.setenv(name, "")  # so that it is put back
        monkeypatch.delenv(name)
    forgotten = (settle_caches, require_caches, caches._temporary)
    for function in forgotten:
        function.cache_clear()
    yield
    for function in forgotten:
        function.cache_clear()


def test_a_users_folder_is_used_as_it_is(tmp_path: Path) -> None:
    assert settle_caches() == Caches(tmp_path / ".cache")
    assert not set(VARIABLES) & os.environ.keys()


@contextmanager
def as_nobody() -> Iterator[None]:
    """Act as a user who may not write everywhere, as root may."""
    if os.getuid() != 0:
        yield
        return
    os.setresuid(NOBODY, NOBODY, 0)
    try:
        yield
    finally:
        os.setresuid(0, 0, 0)


def test_a_home_of_another_user_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a container that runs as any user and keeps the home of root."""
    home = tmp_path / "home"
    home.mkdir(mode=0o000)  # not even to be looked into
    monkeypatch.setenv("HOME", str(home))
    with as_nobody():
        caches = settle_caches()
        assert caches.folder is not None
        assert folder_problem(caches.folder) == ""
    denied = f"{home}/.cache cannot be written (Permission denied); set XDG"
    assert caches.problem.startswith(denied)
    assert os.environ["XDG_CACHE_HOME"] == str(caches.folder / "xdg_cache_home")


def test_a_user_without_a_home_has_a_temporary_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unknown(_: int) -> None:
        raise KeyError

    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("HOME")
    monkeypatch.setattr("pwd.getpwuid", unknown)
    caches = settle_caches()
    assert caches.problem.startswith("there is no home folder; set XDG_CACHE_HOME to a folder")
    assert os.environ["XDG_CACHE_HOME"].startswith(str(caches.folder))
    assert not list(tmp_path.iterdir())


def test_a_database_of_another_user_is_seen() -> None:
    """pyopencl would raise errors of its database."""
    with TemporaryDirectory() as folder:
        os.chmod(folder, 0o777)
        file = Path(folder) / "invokers.sqlite"
        file.touch(0o444)
        with as_nobody():
            assert folder_problem(Path(folder)) == f"{file} cannot be written"


@pytest.mark.parametrize("path", ["relative", ""])
def test_a_relative_path_is_as_good_as_none(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", path)
    assert settle_caches() == Caches(tmp_path / ".cache")
    assert os.environ["XDG_CACHE_HOME"] == str(tmp_path / ".cache")
    assert [each.name for each in tmp_path.iterdir()] == [".cache"]


@pytest.mark.parametrize("name", VARIABLES)
def test_a_temporary_folder_takes_the_place_of_one_that_cannot_be_written(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(name, str(tmp_path / "file"))
    require_caches()
    require_caches()
    assert os.environ[name] != str(tmp_path / "file")
    (line,) = caplog.messages
    assert line == (
        f"compiled kernels are not kept for the next run: {tmp_path / 'file'} cannot be written "
        f"(File exists); set {name} to a folder with room"
    )


def test_a_folder_of_another_user_within_is_seen(tmp_path: Path) -> None:
    """As a file in its place is, which even root cannot write to."""
    (tmp_path / ".cache").mkdir()
    (tmp_path / ".cache" / "pocl").write_text("")
    assert str(tmp_path / ".cache" / "pocl") in settle_caches().problem


def test_a_full_disk_is_seen_before_anything_is_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(caches, "NEEDED", 2**60)
    assert folder_problem(tmp_path).startswith(f"{tmp_path} is on a disk with ")
    with pytest.raises(
        DeviceError, match=r"^no folder can hold compiled kernels: .* free; set XDG"
    ):
        require_caches()


def test_no_temporary_folder_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(prefix: str) -> str:
        raise FileNotFoundError(2, "No usable temporary directory found in ['/tmp']")

    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/none")
    monkeypatch.setattr("tempfile.mkdtemp", fail)
    with pytest.raises(DeviceError, match="No usable temporary directory"):
        describe_devices()


@pytest.mark.thorough
def test_kernels_run_without_a_home(tmp_path: Path) -> None:
    """/proc refuses even root. The temporary folder is gone afterwards."""
    if not any("pocl" in info.vendor.lower() and not info.problem for info in describe_devices()):
        pytest.skip("no PoCL that knows this processor")
    code = (
        "import numpy as np; from iprt.device.choose import choose_device\n"
        "from iprt.device.compute import ComputeDevice\n"
        "import pyopencl as cl\n"
        "device = ComputeDevice(choose_device('pocl')); out = device.zeros('out', (64,))\n"
        "source = '__kernel void one(__global float *o) { o[get_global_id(0)] = 1.0f; }'\n"
        "cl.Kernel(cl.Program(device.context, source).build(), 'one')(\n"
        "    device.queue, (64,), (64,), out.data)\n"
        "print(device.read(out).sum())"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, "HOME": "/proc/none", "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.stdout == "64.0\n", result.stderr
    assert not list(tmp_path.glob("iprt-*"))
