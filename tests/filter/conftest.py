"""The tests of the filter run on a device of either kind."""

from __future__ import annotations

import pytest

from iprt.device.compute import ComputeDevice
from tests.like_gpu import LikeGpu


@pytest.fixture(params=[ComputeDevice, LikeGpu], ids=["CPU", "GPU"])
def device(request: pytest.FixtureRequest, device: ComputeDevice) -> ComputeDevice:
    """A device, and the same with what is done on GPUs: planes in half precision, for one."""
    made: ComputeDevice = request.param(device.device)
    return made
