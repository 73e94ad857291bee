"""Compiled programs on disk: read in place of a build, and built again where that fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from iprt.device import binaries
from iprt.device.binaries import build_kept
from iprt.device.compilers import POCL
from iprt.device.compute import ComputeDevice
from iprt.device.program import Program

DOUBLE = Program.of_text(
    "__kernel void twice(__global float *x) { x[get_global_id(0)] *= BY; }", "twice.cl", {"BY": 2.0}
)


@pytest.fixture
def builds(device: ComputeDevice, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Program]:
    """Programs that are built from source from now on; at first, none is kept."""
    if device.device.platform.name.strip() != POCL:
        pytest.skip("other drivers build from source")
    built: list[Program] = []
    build = binaries.build

    def counted(context: cl.Context, program: Program) -> Any:
        built.append(program)
        return build(context, program)

    monkeypatch.setattr(binaries, "build", counted)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return built


def require_doubles(device: ComputeDevice, built: Any) -> None:
    values = np.arange(64, dtype=np.float32)
    array = device.upload("values", values)
    cl.Kernel(built, "twice")(device.queue, (64,), (64,), array.data)
    np.testing.assert_array_equal(device.read(array), 2.0 * values)


def test_a_program_is_built_once(device: ComputeDevice, builds: list[Program]) -> None:
    for _ in range(2):
        require_doubles(device, build_kept(device.context, DOUBLE))
    assert builds == [DOUBLE]


def test_what_the_driver_refuses_is_built_again(
    device: ComputeDevice, builds: list[Program], monkeypatch: pytest.MonkeyPatch
) -> None:
    damaged = {"binary": np.arange(99, dtype=np.uint8)}
    monkeypatch.setattr(binaries, "kept", lambda *_: damaged)
    require_doubles(device, build_kept(device.context, DOUBLE))
    assert builds == [DOUBLE]
