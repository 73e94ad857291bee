"""Parameters that are read from sources, against what the driver knows of the same programs."""

from __future__ import annotations

import numpy as np
import pyopencl as cl
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant, float_constant
from iprt.device.signature import Parameter, signature
from iprt.errors import KernelError
from tests.films import entry_points, planned_kernels

SOURCE = """
#define PLANES_IN __global const float *restrict
#define SIGNAL_IN PLANES_IN
static int other(int one) { return one; }
__kernel void tell(const int a, uint b, float c, __global int *d, const int4 e,
                   SIGNAL_IN f)
{
}
"""


def test_kinds() -> None:
    assert signature(SOURCE, "tell") == (
        Parameter("a", np.int32, "int", is_buffer=False),
        Parameter("b", np.uint32, "uint", is_buffer=False),
        Parameter("c", np.float32, "float", is_buffer=False),
        Parameter("d", None, "int", is_buffer=True),
        Parameter("e", None, "int4", is_buffer=False),
        Parameter("f", None, "float", is_buffer=True),
    )


def test_constants() -> None:
    assert constant("lib/gbuffer/guide.h", "LEVEL_NONE") == 255
    assert float_constant("lib/world/real/learned.h", "ALIKE_NORMAL") == 0.7


def test_no_such_kernel() -> None:
    with pytest.raises(KernelError, match="no kernel 'missing'"):
        signature("__kernel void present(int a) {}", "missing")


@pytest.mark.thorough
def test_every_list_of_parameters_of_every_kernel(device: ComputeDevice) -> None:
    variants = planned_kernels(is_cpu=device.is_cpu)
    assert {one.name for one in variants} == entry_points()
    told_before = set()
    for file, name, defines, *_ in variants:
        kernel = device.kernel(file, name, defines)
        if (name, kernel.signature) in told_before:
            continue
        told_before.add((name, kernel.signature))
        made = kernel.make()
        declared = [
            (
                # PoCL renames what is named like a function of OpenCL.
                made.get_arg_info(i, cl.kernel_arg_info.NAME).removeprefix("_cl_"),
                made.get_arg_info(i, cl.kernel_arg_info.TYPE_NAME),
            )
            for i in range(made.num_args)
        ]
        scalars = {np.int32: "int", np.uint32: "uint", np.float32: "float", None: None}
        told = [(one.name, scalars[one.scalar]) for one in kernel.signature]
        assert [name for name, _ in told] == [name for name, _ in declared], (file, name, defines)
        for (_, kind), (_, of_driver) in zip(told, declared, strict=True):
            assert kind == of_driver or (kind is None and of_driver not in scalars.values())
