"""Oclgrind, as `tests.oclgrind` calls it, finds what is wrong, and nothing where all is right."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.oclgrind import LIBRARY, MISSING, watch

pytestmark = [
    pytest.mark.skipif(not LIBRARY.exists(), reason=MISSING),
    pytest.mark.thorough,
]

SOURCE = """
__kernel void planted(__global const float *restrict in, __global float *restrict out, int count)
{
    int i = get_global_id(0);
    if (i >= count)
        return;
    float3 fine = (float3)(in[i], in[i], 1.0f);
    %s
}
"""
PROGRAM = """
import json
import numpy as np
from tests.oclgrind import SimulatedDevice
device = SimulatedDevice()
kernel = device.kernel({file!r}, "planted")
source = device.upload("source", np.ones(70, np.float32))
result = device.zeros("result", (70,))  # kept: what takes its place would count as written
kernel((70,), {{"in": source}}, out=result, count=70)
unwritten = device.empty("unwritten", (70,))
device.finish()
{more}
device.finish()
print(json.dumps(["planted"]))
"""


def findings(tmp_path: Path, statement: str, more: str = "") -> list[str]:
    file = tmp_path / "planted.cl"
    file.write_text(SOURCE % statement)
    return watch(PROGRAM.format(file=str(file), more=more)).findings


def test_a_sound_kernel_has_no_finding(tmp_path: Path) -> None:
    assert findings(tmp_path, "out[i] = in[i] + fine.x;") == []


@pytest.mark.parametrize(
    ("statement", "says"),
    [
        ("out[i] = in[i + 1];", "Invalid read of size 4"),
        ("out[i - 1] = in[i];", "Invalid write of size 4"),
        ("out[i / 2] = in[i] + i;", "Write-write data race"),
        ("out[i] = in[i]; out[i] += out[(i + 64) % 70];", "Read-write data race"),
        (
            "float unset[2]; unset[i & 1] = 1.0f; out[i] = unset[0];",
            "ninitialized",
        ),
    ],
)
def test_a_planted_defect_is_found(tmp_path: Path, statement: str, says: str) -> None:
    found = findings(tmp_path, statement)
    assert any(says in report and "planted" in report for report in found), found


def test_unwritten_buffers_are_told_from_zeroed_ones(tmp_path: Path) -> None:
    launch = 'kernel((70,), {"in": unwritten}, out=device.zeros("copy", (70,)), count=70)'
    found = findings(tmp_path, "out[i] = in[i];", launch)
    assert len(found) == 1, found
    assert "Uninitialized value written" in found[0]


def test_a_program_that_fails_is_a_finding(tmp_path: Path) -> None:
    assert findings(tmp_path, "this is no OpenCL")[-1].startswith("ended with status 1")
