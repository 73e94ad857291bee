"""The tests of the filter run on a device of either kind."""

from __future__ import annotations

from pathlib import Path

import pytest

from iprt.device.compute import ComputeDevice

FOLDER = Path(__file__).parent


@pytest.hookimpl(tryfirst=True)  # before -m counts
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out views around that are narrower than 33 pixels on a GPU.

    They have programs of their own, which no scene needs and which CPUs try.
    """
    vain = {item for item in items if item.path.parent == FOLDER and _in_vain(item)}
    if vain:
        config.hook.pytest_deselected(items=list(vain))
        items[:] = [item for item in items if item not in vain]


def _in_vain(item: pytest.Item) -> bool:
    given = item.callspec.params if hasattr(item, "callspec") else {}
    narrow = given.get("equirect", False) and given.get("width", 33) < 33
    return bool(narrow) and given.get("device") == "GPU"


@pytest.fixture(params=["CPU", "GPU"])
def device(
    request: pytest.FixtureRequest, device: ComputeDevice, gpu: ComputeDevice
) -> ComputeDevice:
    """Return the device, and the same device treated as a GPU."""
    return device if request.param == "CPU" else gpu
