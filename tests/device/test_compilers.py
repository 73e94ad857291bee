"""Kernels that other processes compile: the launch here finds them in a cache."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pyopencl as cl
import pytest
from pyopencl.cache import create_built_program_from_source_cached

from iprt.device import compilers
from iprt.device.choose import choose_device, describe_devices
from iprt.device.compile import GROUPS
from iprt.device.compilers import Compilers
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.program import PlannedKernel, Program
from tests.films import films, play

FILE, NAME = "world/real/pyramid.cl", "reduce_range"
CRASHES = """
__kernel void crash(__global int *out, const int which)
{
    out[get_global_id(0)] = 1 / which;
}
__kernel void fine(__global int *out)
{
    out[get_global_id(0)] = 1;
}
"""


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of kernels."""
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path))
    return tmp_path


@pytest.fixture
def several(cache: Path) -> Compilers:
    """Two processes for PoCL."""
    return Compilers(choose_device("pocl"), 2)


def compiled(cache: Path) -> list[str]:
    """Return the names of the kernels in PoCL's cache."""
    return sorted(path.stem for path in cache.rglob("*.so"))


def test_a_kernel_is_compiled_elsewhere(several: Compilers, cache: Path) -> None:
    program = Program.of(FILE)
    several.request(program, NAME, 0)
    several.wait(program, NAME)
    assert compiled(cache) == [NAME]


def test_it_is_asked_for_once(
    several: Compilers, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also by processes that come later."""
    program = Program.of(FILE)
    for _ in range(3):
        several.request(program, NAME, 0)
    several.wait(program, NAME)
    assert len(list((cache / "iprt").iterdir())) == 1

    def start(_: Compilers) -> None:
        raise AssertionError

    monkeypatch.setattr(Compilers, "_start", start)
    later = Compilers(choose_device("pocl"), 2)
    later.request(program, NAME, 0)
    later.wait(program, NAME)


def test_grids_of_either_size(several: Compilers, cache: Path) -> None:
    program = Program.of(FILE)
    several.request(program, NAME, compilers.SMALL_GRID)
    several.request(program, NAME, compilers.SMALL_GRID + 1)
    several.wait(program, NAME)
    folders = sorted(path.parent.name for path in cache.rglob("*.so"))
    assert folders == ["64-1-1-goffs0", "64-1-1-goffs0-smallgrid"]


def test_kernels_of_tiles_have_groups_of_their_own(several: Compilers, cache: Path) -> None:
    """PoCL compiles for the group of the launch; another one would be for nothing."""
    program = Program.of("filter/neighbours.cl")
    several.request(program, "interpolate", 0)
    several.wait(program, "interpolate")
    assert [path.parent.name for path in cache.rglob("*.so")] == ["16-4-1-goffs0-smallgrid"]
    group = ComputeDevice(choose_device("pocl")).group_size
    assert {count: group(count) for count in GROUPS} == GROUPS


def test_dimensions_of_grids_are_read_from_the_source(device: ComputeDevice) -> None:
    launched: set[tuple[str, str, int]] = set()
    launch = Kernel.__call__

    def record(self: Kernel, size: tuple[int, ...], *groups: Any, **own: Any) -> None:
        launched.add((self.program, self.name, max(len(size), 2)))
        launch(self, size, *groups, **own)

    with mock.patch.object(Kernel, "__call__", record):
        play(device, films()["around"])
    programs = {program.name: program for program in device.built_programs}
    read = {(name, kernel, programs[name].dimensions(kernel)) for name, kernel, _ in launched}
    assert read == launched
    assert {dimensions for _, _, dimensions in launched} == set(GROUPS)


def test_a_crash_ends_nothing_but_its_process(several: Compilers, cache: Path) -> None:
    program = Program.of_text(CRASHES, "crashes.cl")
    for name in ("crash", "fine"):
        several.request(program, name, 0)
    several.wait(program, "crash")
    several.wait(program, "fine")
    assert "fine" in compiled(cache)


def test_what_does_not_build_is_left_to_the_launch(several: Compilers, cache: Path) -> None:
    program = Program.of_text("__kernel void wrong(int a) { nowhere; }", "wrong.cl")
    several.request(program, "wrong", 0)
    several.wait(program, "wrong")
    assert not compiled(cache)
    assert not (cache / "iprt").exists()


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core compiles by itself")
def test_a_device_launches_what_was_compiled(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compilers, "MOST_PROCESSES", 2)
    device = ComputeDevice(choose_device("pocl"))
    device.compile([PlannedKernel(FILE, NAME, {})])
    assert device._compilers is not None
    device._compilers.wait(Program.of(FILE), NAME)
    before = compiled(cache)
    kernel = device.kernel(FILE, NAME)
    source = device.upload("source", np.ones((2, 4, 2), np.float32))
    arguments = {one.name: source if one.is_buffer else 0 for one in kernel.signature}
    kernel((1, 1), arguments)
    device.finish()
    assert compiled(cache) == before == [NAME]


def test_programs_of_intels_runtime_are_kept(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    handles = [info.handle for info in describe_devices() if info.platform == compilers.INTEL]
    if not handles:
        pytest.skip("Intel's OpenCL runtime is not installed")
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    program, context = Program.of(FILE), cl.Context(handles[:1])
    several = Compilers(handles[0], 2)
    several.request(program, NAME, 0)
    several.wait(program, NAME)
    _, kept = create_built_program_from_source_cached(
        context, program.text, " ".join(program.options).encode()
    )
    assert kept


def test_other_drivers_have_none() -> None:
    known = compilers.POCL, compilers.INTEL
    others = [info for info in describe_devices() if info.platform.strip() not in known]
    assert all(Compilers.of(info.handle) is None for info in others)
