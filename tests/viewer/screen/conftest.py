"""A desktop viewer, and one who sits before it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from iprt.device.compute import ComputeDevice

if TYPE_CHECKING:
    from tests.viewer.screen.user import User


@pytest.fixture(scope="module")
def opened(device: ComputeDevice, tmp_path_factory: pytest.TempPathFactory) -> Iterator[User]:
    """One viewer for all tests of a file."""
    from tests.viewer.screen.user import seated

    with seated(device, tmp_path_factory.mktemp("desktop")) as user:
        yield user


@pytest.fixture
def user(opened: User) -> Iterator[User]:
    """Before the viewer as it was opened."""
    opened.away()
    yield opened
    opened.reset()
