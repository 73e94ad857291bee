"""Blocks of arguments: what is bound by name arrives there, in every variant of a program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
import pytest

from iprt.device.block import Block, Float4, Float32, Floats, Int32, when
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.program import Program, build
from iprt.errors import KernelError

INNER = """
#include <tests.device.test_block>
__kernel void run(const int n, const Outer outer, __global float *restrict out, const Extra extra)
{
    const int i = get_global_id(0);
    if (i >= n)
        return;
    out[i] = outer.low + 10.0f * outer.high + 1000.0f * outer.place.y;
    out[i] += 100.0f * outer.inner.values[i];
#ifdef MORE
    out[i] += 10000.0f * outer.more.count;
#endif
#ifndef LESS
    out[i] += 100000.0f * extra.count;
#endif
}
"""


@dataclass(kw_only=True)
class InnerArgs(Block):
    """Nested in another."""

    values: Floats
    count: Int32 = 0


@dataclass(kw_only=True)
class OuterArgs(Block):
    """Two floats that would be swapped without names."""

    high: Float32
    low: Float32
    place: Float4
    inner: InnerArgs
    more: InnerArgs | None = when("MORE")


@dataclass(kw_only=True)
class ExtraArgs(Block):
    """Without members in some programs."""

    count: Int32 = when("!LESS")


def kernel(device: ComputeDevice, **defines: bool) -> Kernel:
    program = Program.of_text(INNER, "run.cl", defines)
    built = build(device.context, program)
    return Kernel(device, lambda: cl.Kernel(built, "run"), "run", "run", program.signature("run"))


@pytest.mark.parametrize("more", [False, True])
@pytest.mark.parametrize("less", [False, True])
def test_members_arrive_by_name(device: ComputeDevice, more: bool, less: bool) -> None:
    run = kernel(device, MORE=more, LESS=less)
    values = device.upload("values", np.arange(3, dtype=np.float32))
    inner = InnerArgs(values=values, count=7)
    outer = OuterArgs(
        low=1.0, high=2.0, place=cl.cltypes.make_float4(0, 3, 0, 0), inner=inner, more=inner
    )
    out = device.zeros("out", (3,))
    run((3,), {"extra": ExtraArgs(count=5)}, n=3, outer=outer, out=out)
    wanted = 3021.0 + 100.0 * np.arange(3) + 70000.0 * more + 500000.0 * (not less)
    np.testing.assert_array_equal(device.read(out), wanted)


def test_a_part_that_the_program_has_must_be_given(device: ComputeDevice) -> None:
    run = kernel(device, MORE=True, LESS=True)
    inner = InnerArgs(values=None)
    outer = OuterArgs(low=1.0, high=2.0, place=None, inner=inner)
    with pytest.raises(TypeError, match="is not given 'outer_more_"):
        run((3,), n=3, outer=outer, out=device.zeros("out", (3,)))


def test_errors_are_reported_at_their_line(device: ComputeDevice) -> None:
    wrong = INNER.replace("return;", "return nowhere;")
    number = wrong.splitlines().index("        return nowhere;") + 1
    with pytest.raises(KernelError, match=rf"run\.cl:{number}:.*nowhere"):
        build(device.context, Program.of_text(wrong, "run.cl"))


BATCH = """
#define MOST_ENTRIES 3
__kernel void run(const int n, const float add[MOST_ENTRIES], const int one[1],
                  __global float *restrict out)
{
    const int i = get_global_id(0);
    if (i < n && entry < 3)
        out[entry * n + i] = add + one;
}
"""


def test_batches_have_entries_of_their_own(device: ComputeDevice) -> None:
    program = Program.of_text(BATCH, "run.cl")
    built = build(device.context, program)
    run = Kernel(device, lambda: cl.Kernel(built, "run"), "run", "run", program.signature("run"))
    out = device.zeros("out", (3, 2))
    run((2, 1, 3), n=2, add_0=0.25, add_1=0.5, add_2=0.75, one_0=100, out=out)
    np.testing.assert_array_equal(device.read(out)[:, 0], [100.25, 100.5, 100.75])
