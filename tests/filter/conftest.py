"""The tests of the filter run on a device of either kind."""

from __future__ import annotations

import pytest

from iprt.device.compute import ComputeDevice


@pytest.fixture(params=["CPU", "GPU"])
def device(
    request: pytest.FixtureRequest, device: ComputeDevice, gpu: ComputeDevice
) -> ComputeDevice:
    """Return the device, and the same device treated as a GPU."""
    return device if request.param == "CPU" else gpu
