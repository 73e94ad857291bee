"""Building programs: what another process can disturb is tried again."""

from __future__ import annotations

from typing import Any

import pyopencl as cl
import pytest

from iprt.device import compute
from iprt.device.compute import BUILD_TRIES, CACHE_RACE, ComputeDevice
from iprt.errors import KernelError

RACE = f"clBuildProgram failed: BUILD_PROGRAM_FAILURE\nerror: {CACHE_RACE} 'a' to output file 'b'"


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the next builds fail with; those after them succeed."""
    failures: list[str] = []
    build = cl.Program.build

    def failing(self: Any, *args: Any, **kwargs: Any) -> Any:
        if failures:
            raise cl.RuntimeError(failures.pop(0))
        return build(self, *args, **kwargs)

    monkeypatch.setattr(cl.Program, "build", failing)
    monkeypatch.setattr(compute, "BUILD_PAUSE_S", 0.0)
    return failures


def fresh(device: ComputeDevice) -> ComputeDevice:
    """The same device, with nothing built yet."""
    return ComputeDevice(device.device)


def test_a_race_in_the_drivers_cache_is_run_again(device: ComputeDevice, builds: list[str]) -> None:
    builds += [RACE] * (BUILD_TRIES - 1)
    assert fresh(device).kernel("world/real/pyramid.cl", "reduce_range") is not None
    assert not builds


def test_it_is_not_run_for_ever(device: ComputeDevice, builds: list[str]) -> None:
    builds += [RACE] * (BUILD_TRIES + 1)
    with pytest.raises(KernelError, match=CACHE_RACE):
        fresh(device).kernel("world/real/pyramid.cl", "reduce_range")
    assert len(builds) == 1


def test_other_failures_are_reported_at_once(device: ComputeDevice, builds: list[str]) -> None:
    builds += ["error: use of undeclared identifier"] * 2
    with pytest.raises(KernelError, match="undeclared identifier"):
        fresh(device).kernel("world/real/pyramid.cl", "reduce_range")
    assert len(builds) == 1
