"""Parameters that are read from sources, against what the driver knows of the same programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyopencl as cl
import pytest

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import KernelSource, constant, float_constant
from iprt.device.signature import Parameter, signature
from iprt.errors import KernelError
from tests.films import entry_points, planned_kernels

HEADER = """
#ifndef PAIR_H
#define PAIR_H
#define PAIR(name) __global const float4 *restrict name##_low, \\
    __global const float4 *restrict name##_high   // continued
#endif
"""
SOURCE = """
#include "pair.h"
#include "pair.h"
#if defined(WIDE) && TAPS >= 5 || !defined(TAPS)
#define LAST , const uint last
#elif TAPS == 3
#define LAST , const int three
#else
#define LAST
#endif
#define ALL PAIR(box) LAST
static int other(int one) { return one; }
__kernel void tell(
    __global float *restrict out,  // (a comment, with things)
#ifdef WIDE
    const float width, /* and
    int more */
#ifndef TAPS
    int never,
#endif
#endif
    ALL)
{
}
"""


def read(text: str, folder: Path = Path(), **defines: str) -> KernelSource:
    source = KernelSource(folder)
    source.define(defines)
    source.read(text, "tell.cl")
    return source


def names(tmp_path: Path, **defines: str) -> list[str]:
    (tmp_path / "pair.h").write_text(HEADER)
    return [one.name for one in signature(read(SOURCE, tmp_path, **defines), "tell")]


def test_conditions_macros_and_included_files(tmp_path: Path) -> None:
    boxes = ["box_low", "box_high"]
    assert names(tmp_path) == ["out", *boxes, "last"]
    assert names(tmp_path, TAPS="3") == ["out", *boxes, "three"]
    assert names(tmp_path, TAPS="4") == ["out", *boxes]
    assert names(tmp_path, TAPS="5", WIDE="1") == ["out", "width", *boxes, "last"]
    assert names(tmp_path, WIDE="1") == ["out", "width", "never", *boxes, "last"]


def test_kinds() -> None:
    source = "__kernel void k(const int a, uint b, float c, __global int *d, const int4 e) {}"
    assert signature(read(source), "k") == (
        Parameter("a", np.int32, "int", is_buffer=False),
        Parameter("b", np.uint32, "uint", is_buffer=False),
        Parameter("c", np.float32, "float", is_buffer=False),
        Parameter("d", None, "int", is_buffer=True),
        Parameter("e", None, "int4", is_buffer=False),
    )


def test_constants_of_headers() -> None:
    """Those of the files that they include too."""
    assert constant("lib/gbuffer/guide.h", "LEVEL_NONE") == 255
    assert constant("filter/mask.cl", "GUIDE_PLANES") == 7
    assert float_constant("lib/world/real/learned.h", "ALIKE_NORMAL") == 0.7


def test_no_such_kernel() -> None:
    with pytest.raises(KernelError, match="no kernel 'missing'"):
        signature(read("__kernel void present(int a) {}"), "missing")


@pytest.mark.thorough
def test_every_variant_of_every_kernel(device: ComputeDevice) -> None:
    variants = planned_kernels()
    assert {one.name for one in variants} == entry_points()
    for file, name, defines, *_ in variants:
        kernel = device.kernel(file, name, defines)
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
