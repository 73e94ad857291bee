"""Waiting for other processes and threads."""

from __future__ import annotations

import time
from collections.abc import Callable

DEADLINE_S = 300.0
"""Seconds after which something hangs, on a machine however busy. No outcome depends on it."""


def until(done: Callable[[], bool], pause_s: float = 0.01) -> None:
    """Wait until something is so."""
    end = time.monotonic() + DEADLINE_S
    while not done():
        assert time.monotonic() < end, f"not so within {DEADLINE_S:.0f} s"
        time.sleep(pause_s)
