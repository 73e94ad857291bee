"""The compilation for GPUs, as `tests.gpu` does it, finds what is wrong with a kernel."""

from __future__ import annotations

from pathlib import Path

import pytest

from iprt.device.program import Program
from tests import gpu
from tests.gpu import CompileError, Need, compiled, exceeded

pytestmark = [
    pytest.mark.skipif(not gpu.installed(), reason=gpu.MISSING),
    pytest.mark.thorough,
]

SOURCE = """
%s
__kernel void planted(__global const float *restrict in, __global float *restrict out)
{
    const int i = get_global_id(0);
    float sum = in[i];
    %s
    out[i] = sum;
}
"""


def needs(tmp_path: Path, statement: str, before: str = "") -> dict[tuple[str, str], Need]:
    return compiled(Program.of_text(SOURCE % (before, statement), "planted.cl"), tmp_path)


def test_a_sound_kernel_needs_little(tmp_path: Path) -> None:
    found = needs(tmp_path, "sum += sqrt(in[i + 1]);")
    assert set(found) == {("nvidia", "planted"), ("amd", "planted")}
    assert all(0 < need.registers <= 32 and need.stack == 0 for need in found.values())
    assert exceeded(found) == []


def test_arrays_of_its_own_are_stack(tmp_path: Path) -> None:
    found = needs(
        tmp_path,
        "float own[100]; for (int j = 0; j < 100; j++) own[j] = in[j] * i;"
        "for (int j = 0; j < 100; j++) sum += own[(j * i) % 100];",
    )
    assert all(need.stack >= 400 for need in found.values())
    assert len(exceeded(found)) == 2


def test_inline_functions_that_are_not_static_do_not_link(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match="more"):
        needs(
            tmp_path,
            "for (int j = 0; j < i; j++) sum = more(more(sum));",
            "inline __attribute__((noinline)) float more(float x) { return 2.0f * x; }",
        )


def test_double_precision(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match="double precision"):
        needs(tmp_path, "sum = sum * 1.1;", "#pragma OPENCL EXTENSION cl_khr_fp64 : enable")
