"""Steps for `tests/device/test_on_device.py`, whose cases do what drivers do."""

from __future__ import annotations

import os
import signal
import time

from tests.on_device.cases import Asked, Cases, Row


def cases(asked: Asked) -> Cases:
    """Those whose names `asked.device` lists."""
    known = {"well": well, "also well": well, "crashes": crashes, "raises": raises, "hangs": hangs}
    return {name: known[name] for name in asked.device.split(",")}


def well() -> list[Row]:
    return [{"ms": 1.5, "passes": {"temporal": 0.5}}]


def crashes() -> list[Row]:
    os.kill(os.getpid(), signal.SIGSEGV)
    return []


def raises() -> list[Row]:
    raise RuntimeError("out of\nresources")


def hangs() -> list[Row]:
    time.sleep(1e6)
    return []
