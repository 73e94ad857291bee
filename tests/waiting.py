"""Waiting for other processes and threads."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[1]

DEADLINE_S = 300.0
"""Seconds after which something hangs, on a machine however busy. No outcome depends on it."""


def until(done: Callable[[], bool], pause_s: float = 0.01) -> None:
    """Wait until something is so."""
    end = time.monotonic() + DEADLINE_S
    while not done():
        assert time.monotonic() < end, f"not so within {DEADLINE_S:.0f} s"
        time.sleep(pause_s)


def run_python(*words: str, cwd: Path = ROOT, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the interpreter with these words and environment variables besides its own."""
    return subprocess.run(
        [sys.executable, *words],
        cwd=cwd,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
        timeout=DEADLINE_S,
    )
