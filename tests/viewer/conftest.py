from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from tests.waiting import DEADLINE_S


@pytest.fixture(autouse=True)
def engines_end() -> Iterator[None]:
    """Engines that a test closed have ended before the next one uses the same device.

    `Engine.close` leaves a thread alone that still compiles after a few seconds.
    """
    before = set(threading.enumerate())
    yield
    for thread in set(threading.enumerate()) - before:
        if thread.name == "iprt viewer":
            thread.join(DEADLINE_S)
