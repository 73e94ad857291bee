"""Fixtures shared by all tests."""

from __future__ import annotations

import pytest

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice


@pytest.fixture(scope="session")
def device() -> ComputeDevice:
    """The device that the tests run on: `IPRT_TEST_DEVICE`, else PoCL, the baseline."""
    import os

    return ComputeDevice(choose_device(os.environ.get("IPRT_TEST_DEVICE", "pocl")))
