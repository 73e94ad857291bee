"""What some OpenCL implementations cannot do, and kernels therefore do not ask for."""

from __future__ import annotations

import math
import re

import numpy as np
import pyopencl as cl
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel, fitting
from iprt.device.program import Program, build
from iprt.device.signature import Parameter
from tests.films import planned_kernels

MOST_BUFFERS = 31
"""What Apple's GPUs let a kernel take."""
MORE_BUFFERS = {
    "trace_delta": 33,
    "trace_virtual": 43,
    "trace_gloss": 40,
    "path_trace_real": 33,
    "path_trace_virtual": 33,
}
"""Kernels with variants that do not run there: lamps, reflections of `iprt2023`, paths of `oil`."""
NAMED = "half", "STORED", "LIGHT", "Finish"
"""Halves, and names that programs give to numbers and vectors."""
ELEMENTS = re.compile(r"(uchar|int|uint|float)[234]?")

SOURCE = """
__kernel void visit(__global int *items, __global int *largest, const int width, const int height)
{
    const int x = get_global_id(0), y = get_global_id(1);
    atomic_max(largest, (int)(get_local_size(0) * get_local_size(1)));
    if (x < width && y < height)
        atomic_inc(items + y * width + x);
}
"""

Taken = list[tuple[Program, str, bool, tuple[Parameter, ...]]]


@pytest.fixture(scope="module")
def taken() -> Taken:
    """Program, kernel, whether planes are in half precision, and parameters, as for GPUs."""
    found = []
    for one in planned_kernels():
        program = Program.of(one.file, one.defines)
        half_planes = "HALF_PLANES" in one.defines
        found.append((program, one.name, half_planes, program.signature(one.name)))
    return found


def test_kernels_take_few_buffers(taken: Taken) -> None:
    for program, name, _, parameters in taken:
        buffers = sum(parameter.is_buffer for parameter in parameters)
        assert buffers <= MORE_BUFFERS.get(name, MOST_BUFFERS), (
            f"{name} of {program.file}: {buffers}"
        )


def test_half_precision_is_asked_for(taken: Taken) -> None:
    """It takes storage of 16 bits (clspv): for planes where HALF_PLANES says so, and textures."""
    for program, name, half_planes, parameters in taken:
        half = {parameter.name for parameter in parameters if parameter.kind == "half"}
        textures = {one for one in half if one.endswith("bvh_texels")}
        assert half_planes or half == textures, f"{name} of {program.file}: {half}"


def test_pointers_lie_in_no_buffer(taken: Taken) -> None:
    """clspv knows none there: kernels take numbers, vectors, and structs of these."""
    for program, name, _, parameters in taken:
        for parameter in parameters:
            if parameter.kind in NAMED or ELEMENTS.fullmatch(parameter.kind):
                continue
            body = re.search(rf"{{([^}}]*)}} {parameter.kind};", program.text)
            assert body is not None, f"{name} of {program.file}: {parameter}"
            for member in body[1].split(";")[:-1]:
                assert ELEMENTS.fullmatch(member.split()[0]), f"{parameter.kind}: {member}"
                assert "*" not in member, f"{parameter.kind}: {member}"


@pytest.mark.parametrize("group", [(64,), (128,), (64, 1), (16, 8), (16, 8, 1)])
@pytest.mark.parametrize("most", [1, 2, 12, 100, 128, 256])
def test_groups_fit(group: tuple[int, ...], most: int) -> None:
    """As the device wants them if they may be, else not smaller than half of what may be."""
    found = fitting(group, most)
    if math.prod(group) <= most:
        assert found == group
    else:
        assert most / 2 < math.prod(found) <= most


def test_a_kernel_that_allows_small_groups(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every work item runs, in groups that it allows."""
    monkeypatch.setattr(cl.Kernel, "get_work_group_info", lambda *_: 8)
    program = Program.of_text(SOURCE, "visit")
    built = build(device.context, program)
    parameters = program.signature("visit")
    kernel = Kernel(device, lambda: cl.Kernel(built, "visit"), "visit", "visit", parameters)
    items, largest = device.zeros("items", (5, 37), np.int32), device.zeros("most", (1,), np.int32)
    kernel((37, 5), items=items, largest=largest, width=37, height=5)
    np.testing.assert_array_equal(device.read(items), 1)
    assert device.read(largest)[0] == 8
