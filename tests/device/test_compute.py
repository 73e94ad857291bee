"""Building programs: what another process can disturb is tried again."""

from __future__ import annotations

import mmap
import os
import re
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from iprt.device import program
from iprt.device.compute import ComputeDevice
from iprt.device.host_memory import HUGE_PAGE, LARGE, MOST_SPARE, HostMemory
from iprt.device.kernel import Kernel
from iprt.device.profile import MOST_PENDING
from iprt.device.program import BUILD_TRIES, CACHE_RACE
from iprt.errors import KernelError

RACE = f"clBuildProgram failed: BUILD_PROGRAM_FAILURE\nerror: {CACHE_RACE} 'a' to output file 'b'"


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the next builds fail with; those after them succeed."""
    failures: list[str] = []
    name = "create_built_program_from_source_cached"
    build = getattr(program, name)

    def failing(*args: Any, **kwargs: Any) -> Any:
        if failures:
            raise cl.RuntimeError(failures.pop(0))
        return build(*args, **kwargs)

    monkeypatch.setattr(program, name, failing)
    monkeypatch.setattr(program, "BUILD_PAUSE_S", 0.0)
    return failures


def fresh(device: ComputeDevice) -> ComputeDevice:
    """The same device, with nothing built yet."""
    return ComputeDevice(device.device)


def test_a_race_in_the_drivers_cache_is_run_again(device: ComputeDevice, builds: list[str]) -> None:
    builds += [RACE] * (BUILD_TRIES - 1)
    assert fresh(device).kernel("world/real/pyramid.cl", "reduce_range").make() is not None
    assert not builds


def test_it_is_not_run_for_ever(device: ComputeDevice, builds: list[str]) -> None:
    builds += [RACE] * (BUILD_TRIES + 1)
    with pytest.raises(KernelError, match=CACHE_RACE):
        fresh(device).kernel("world/real/pyramid.cl", "reduce_range").make()
    assert len(builds) == 1


def test_other_failures_are_reported_at_once(device: ComputeDevice, builds: list[str]) -> None:
    builds += ["error: use of undeclared identifier"] * 2
    with pytest.raises(KernelError, match="undeclared identifier"):
        fresh(device).kernel("world/real/pyramid.cl", "reduce_range").make()
    assert len(builds) == 1


SCALE = """
__kernel void scale(__global const float *in, __global float *out, const float by, const int add)
{
    out[get_global_id(0)] = by * in[get_global_id(0)] + add;
}
"""


def scale(device: ComputeDevice, tmp_path: Path) -> Kernel:
    (tmp_path / "scale.cl").write_text(SCALE)
    return device.kernel(str(tmp_path / "scale.cl"), "scale")


def test_arguments_stay_bound_until_they_change(device: ComputeDevice, tmp_path: Path) -> None:
    kernel = scale(device, tmp_path)
    source = [device.upload("source", np.full(64, value, np.float32)) for value in (1.0, 2.0)]
    result = [device.zeros(f"result {i}", (64,)) for i in range(2)]
    for inside, out, by, add in (
        (0, 0, 2.0, 0),
        (1, 0, 2.0, 0),
        (1, 1, 2.0, 0),
        (1, 1, 0.0, 0),
        (1, 1, 3.0, 7),
        (1, 1, 3.0, True),
        (0, 1, 3.0, 0),
    ):
        kernel((64,), {"in": source[inside]}, out=result[out], by=by, add=add)
        expected = np.float32(by) * np.float32(inside + 1) + np.float32(add)
        assert (device.read(result[out]) == expected).all()


@pytest.fixture
def bound(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Indices of the arguments that kernels bind, one after the other."""
    indices: list[int] = []
    bind = cl.Kernel.set_arg

    def watched(self: cl.Kernel, index: int, value: Any) -> None:
        indices.append(index)
        bind(self, index, value)

    monkeypatch.setattr(cl.Kernel, "set_arg", watched)
    return indices


def test_what_has_not_changed_is_not_bound_again(
    device: ComputeDevice, tmp_path: Path, bound: list[int]
) -> None:
    kernel = scale(device, tmp_path)
    given = {"in": device.zeros("source", (64,)), "out": device.zeros("result", (64,))}
    for by in (2.0, float("2"), 3.0):
        kernel((64,), given, by=by, add=1)
    assert bound == [0, 1, 2, 3, 2]


def test_buffers_that_take_turns_are_bound_once_each_way(
    device: ComputeDevice, tmp_path: Path, bound: list[int]
) -> None:
    kernel = scale(device, tmp_path)
    one, other = device.upload("one", np.ones(64, np.float32)), device.zeros("other", (64,))
    for turn in range(8):
        source, result = (one, other) if turn % 2 == 0 else (other, one)
        kernel((64,), {"in": source, "out": result}, by=2.0, add=turn // 2)
        assert (device.read(result) == [2, 4, 9, 19, 40, 82, 167, 337][turn]).all()
    assert bound == [0, 1, 2, 3, 0, 1, 2, 3, *[3] * 6]


def test_what_is_fixed_is_bound_once_and_not_given(
    device: ComputeDevice, tmp_path: Path, bound: list[int]
) -> None:
    """Also by the second of the OpenCL kernels that a call site has."""
    one, other = device.upload("one", np.ones(64, np.float32)), device.zeros("other", (64,))
    kernel = scale(device, tmp_path).fixed({"by": 2.0, "for others": 5}).fixed(add=1)
    assert not bound
    for turn in range(4):
        source, result = (one, other) if turn % 2 == 0 else (other, one)
        kernel((64,), {"in": source, "out": result, "by": 0.0})
        assert (device.read(result) == [3, 7, 15, 31][turn]).all()
    assert sorted(bound) == [0, 0, 1, 1, 2, 2, 3, 3]
    assert kernel.buffers == {"in": other, "out": one}
    with pytest.raises(TypeError, match=r"'scale' of .* has no parameter 'offset'"):
        scale(device, tmp_path).fixed(offset=0)
    with pytest.raises(TypeError, match=r"'scale' of .* has no parameter 'add'"):
        scale(device, tmp_path).fixed(add=1)((64,), {"in": one, "out": other, "by": 1.0}, add=2)


def test_names_that_are_missing_or_none_of_the_kernels(
    device: ComputeDevice, tmp_path: Path
) -> None:
    """What groups hold besides is for other kernels."""
    kernel = scale(device, tmp_path)
    array = device.zeros("array", (64,))
    group = {"in": array, "out": array, "for others": 5}
    with pytest.raises(TypeError, match=r"kernel 'scale' of .*scale\.cl is not given 'add'"):
        kernel((64,), group, by=1.0)
    with pytest.raises(TypeError, match=r"'scale' of .* has no parameter 'offset'"):
        kernel((64,), group, by=1.0, add=2, offset=0)
    kernel((64,), group, by=1.0, add=2)
    assert (device.read(array) == 2.0).all()


def test_a_write_does_not_wait_and_keeps_its_values(device: ComputeDevice) -> None:
    """The queue stands still at an event of ours; host memory lives on without a name."""
    held = cl.UserEvent(device.context)
    array = device.zeros("array", (1 << 16,))
    cl.enqueue_barrier(device.queue, wait_for=[held])
    for value in range(3):
        device.write(array, np.full(array.shape, value, np.float32))
    held.set_status(cl.command_execution_status.COMPLETE)
    assert (device.read(array) == 2.0).all()


def test_rows_are_written_alone(device: ComputeDevice) -> None:
    array = device.zeros("array", (6, 4))
    device.write(array[2:4], np.ones((2, 4), np.float32))
    np.testing.assert_array_equal(device.read(array).sum(axis=1), [0.0, 0.0, 4.0, 4.0, 0.0, 0.0])


def test_a_fetch_waits_for_its_copy_alone(device: ComputeDevice) -> None:
    """Not for work behind it, where the queue stands still at an event of ours."""
    held = cl.UserEvent(device.context)
    array = device.zeros("array", (64,))
    device.write(array, np.ones(64, np.float32))
    fetched = device.fetch(array)
    cl.enqueue_barrier(device.queue, wait_for=[held])
    device.write(array, np.full(64, 2.0, np.float32))
    try:
        assert (fetched() == 1.0).all()
    finally:
        held.set_status(cl.command_execution_status.COMPLETE)
    assert (fetched() == 1.0).all()
    assert (device.read(array) == 2.0).all()


def resident() -> int:
    """Bytes of the process's memory that are in use."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_memory_of_a_discarded_buffer_is_given_back(device: ComputeDevice) -> None:
    if not device.is_cpu:
        pytest.skip("zeros are not in the host's memory")
    own = fresh(device)
    array = own.zeros("array", (1 << 24,))
    own.write(array, np.ones(array.shape, np.float32))
    own.wait()
    before = resident()
    own.discard(array)
    assert resident() < before - array.nbytes // 2
    own.write(array[:64], np.ones(64, np.float32))
    assert own.read(array).sum() == 64.0


def test_what_was_written_is_not_kept(device: ComputeDevice) -> None:
    """Neither by the device, once it has come so far, nor for times that are yet to be read."""
    own = fresh(device)
    array = own.empty("array", (1 << 16,))
    values = np.ones(1 << 16, np.float32)
    kept = weakref.ref(values)
    own.write(array, values)
    del values
    own.wait()
    assert kept() is None
    own.finish()
    own.profile.resolve()
    assert sum(cost.launches for cost in own.profile.totals().values()) == 1


def test_values_that_were_read_are_kept_by_nothing(device: ComputeDevice) -> None:
    """Pictures that a program reads in a loop, and drops, must not fill the memory."""
    own = fresh(device)
    array = own.zeros("values", (64,))
    kept = [weakref.ref(own.read(array)) for _ in range(MOST_PENDING + 1)]
    assert all(values() is None for values in kept)
    assert len(own.profile._pending) < MOST_PENDING


def test_shared_memory_is_read_as_it_is_and_kept_as_long_as_it_is_read(
    device: ComputeDevice,
) -> None:
    own = fresh(device)
    values = np.arange(48, dtype=np.float32).reshape(2, 8, 3)
    kept, expected = weakref.ref(values), values.copy()
    shared = own.share("picture", values)
    assert "picture" not in own.buffers
    np.testing.assert_array_equal(own.read(shared), expected)
    values[0, 0] = expected[0, 0] = 7.0
    np.testing.assert_array_equal(own.read(shared), expected)
    del values
    own.wait()
    assert kept() is not None
    # Kernels may be under way that read it.
    del shared
    assert kept() is not None
    own.wait()
    assert kept() is None


@pytest.mark.skipif(not hasattr(mmap, "MADV_HUGEPAGE"), reason="the system has no huge pages")
@pytest.mark.parametrize("make", ["empty", "zeros"])
def test_large_buffers_of_a_cpu_ask_for_huge_pages(device: ComputeDevice, make: str) -> None:
    """Values start at different lines of a cache, and are aligned for any vector."""
    if not device.is_cpu:
        pytest.skip("the device has its own memory")
    made = [getattr(device, make)(f"large {i}", (LARGE // 4,)) for i in range(4)]
    starts = [array.data.get_host_array((1,), np.float32).ctypes.data for array in made]
    assert len({start % HUGE_PAGE for start in starts}) == 4
    assert not any(start % 64 for start in starts)
    flags: dict[range, str] = {}
    for line in Path("/proc/self/smaps").read_text(encoding="utf-8").splitlines():
        if bounds := re.match(r"([0-9a-f]+)-([0-9a-f]+) ", line):
            at = range(int(bounds[1], 16), int(bounds[2], 16))
        elif line.startswith("VmFlags:"):
            flags[at] = line
    for start in starts:
        assert " hg" in next(line for at, line in flags.items() if start in at)


def test_released_pages_are_used_again() -> None:
    memory = HostMemory()
    first = memory.array((LARGE + 64,), np.uint8, zeros=False)
    first[...] = 7
    memory.release(first)
    again = memory.array((LARGE,), np.uint8, zeros=False)
    assert np.shares_memory(first, again)
    memory.release(again)
    assert not memory.array((LARGE,), np.uint8, zeros=True).any()
    memory.release(np.ones(LARGE, np.uint8))  # of someone else


def test_few_released_pages_are_kept() -> None:
    memory = HostMemory()
    arrays = [memory.array((MOST_SPARE // 2,), np.uint8, zeros=False) for _ in range(3)]
    for array in arrays:
        memory.release(array)
    again = [memory.array((MOST_SPARE // 2,), np.uint8, zeros=False) for _ in range(3)]
    used = [any(np.shares_memory(one, old) for old in arrays) for one in again]
    assert used == [True, False, False]


def test_pages_of_a_buffer_in_use_are_not_released(device: ComputeDevice) -> None:
    """Only those of a buffer that is gone, after the work that used it."""
    if not device.is_cpu:
        pytest.skip("the device has its own memory")
    held, gone = (device.zeros(f"pages {i}", (LARGE // 4,)) for i in range(2))
    at = gone.data.get_host_array((1,), np.float32).ctypes.data
    device.write(held, np.full(LARGE // 4, 3.0))
    del gone
    device.wait()
    made = [device.zeros(f"pages anew {i}", (LARGE // 4,)) for i in range(2)]
    for array in made:
        device.write(array, np.full(LARGE // 4, 5.0))
    assert (device.read(held) == 3.0).all()
    assert at in [array.data.get_host_array((1,), np.float32).ctypes.data for array in made]
