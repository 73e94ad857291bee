"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import hypothesis
import pytest

from iprt import cli
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from tests.like_gpu import LikeGpu
from tests.scene.files import write_scene

# Examples may take long: other programs may run on all cores.
hypothesis.settings.register_profile(
    "any speed", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("any speed")


@pytest.fixture(scope="session")
def device() -> ComputeDevice:
    """The device that the tests run on: `IPRT_TEST_DEVICE`, else PoCL, the baseline."""
    return ComputeDevice(choose_device(os.environ.get("IPRT_TEST_DEVICE", "pocl")))


@pytest.fixture(scope="session")
def gpu(device: ComputeDevice) -> LikeGpu:
    """The same device, with what is done on GPUs: planes in half precision, for one."""
    return LikeGpu(device.device)


@pytest.fixture
def own_accounts(device: ComputeDevice, monkeypatch: pytest.MonkeyPatch) -> ComputeDevice:
    """The device with no buffers accounted yet, for tests of which ones a renderer needs."""
    monkeypatch.setattr(device, "buffers", {})
    monkeypatch.setattr(device, "opengl", {})
    return device


@pytest.fixture
def quick_builds(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """PoCL compiles without optimising, in half the time.

    For tests of what is around kernels, which launch many of them on few pixels. What the optimiser
    makes of kernels is tested by all that compare pictures with the truth.
    """
    # It keeps what it has built for other tests.
    assert "device" not in request.fixturenames, "take `quick_device`"
    monkeypatch.setenv("POCL_EXTRA_BUILD_FLAGS", "-cl-opt-disable")


@pytest.fixture
def quick_device(quick_builds: None) -> ComputeDevice:
    """The device of a test with `quick_builds`."""
    return ComputeDevice(choose_device(os.environ.get("IPRT_TEST_DEVICE", "pocl")))


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Folder of a small scene: a box room with a cube and a view."""
    return write_scene(tmp_path / "room")


@pytest.fixture
def fails(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a verb that must fail, and return its only line."""

    def run(*words: object, code: int = 2) -> str:
        assert cli.main([str(word) for word in words]) == code
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.startswith("iprt: error: ")
        assert captured.err.count("\n") == 1, captured.err
        return captured.err

    return run
