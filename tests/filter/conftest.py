"""The tests of the filter run on a device of either kind."""

from __future__ import annotations

import pytest

from iprt.device.compute import ComputeDevice


@pytest.fixture(params=["CPU", "GPU"])
def device(
    request: pytest.FixtureRequest, device: ComputeDevice, gpu: ComputeDevice
) -> ComputeDevice:
    """A device, and the same with what is done on GPUs."""
    return device if request.param == "CPU" else gpu
