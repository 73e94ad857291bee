"""The tests that say whether kernels do what they should, on the device."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile

from tests.on_device.cases import Asked, Cases, Row

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("kernels", "filter", "view", "world")
WORKERS = 8
ENDING_S = 12.0
"""What pytest gets to end, once time is up."""
HANGING_S = 60
"""After which a test shows where it is, in the log."""
MOST_FAILURES = 40
OUTCOME = re.compile(
    r"^\[gw\d+\] \[ *\d+%\] (?P<word>[A-Z]+) (?P<name>\S.*)$"
    r"|^(?P<plain>\S+::.*?) (?P<plain_word>PASSED|FAILED|ERROR|SKIPPED|XFAIL|XPASS)\b",
    re.MULTILINE,
)
"""A line of `pytest -v` about one test, with pytest-xdist and without."""


def cases(asked: Asked) -> Cases:
    """A folder of tests each; none takes more of the time left than its share."""

    def share(index: int) -> list[Row]:
        left = asked.until - time.monotonic()
        return run(f"tests/{FOLDERS[index]}", asked.device, left / (len(FOLDERS) - index))

    return {f"tests/{name}": partial(share, index) for index, name in enumerate(FOLDERS)}


def run(folder: str, device: str, most_s: float) -> list[Row]:
    """How many tests passed in this time, and a row for each that failed."""
    with TemporaryFile() as out:
        pytest = subprocess.Popen(
            [sys.executable, "-m", "pytest", folder, *_flags()],
            cwd=ROOT,
            env={**os.environ, "IPRT_TEST_DEVICE": device, "OPENBLAS_NUM_THREADS": "1"},
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=out,
        )
        cut = False
        try:
            pytest.wait(max(most_s - ENDING_S, 1.0))
        except subprocess.TimeoutExpired:
            cut = True
            pytest.send_signal(signal.SIGINT)
            try:
                pytest.wait(ENDING_S - 4.0)
            except subprocess.TimeoutExpired:
                pytest.kill()
        out.seek(0)
        told = out.read().decode(errors="replace")
    print(told)
    return summary(told, cut=cut)


def _flags() -> list[str]:
    parallel = []
    if find_spec("xdist"):
        parallel = ["-n", str(min(os.cpu_count() or 1, WORKERS)), "--dist", "worksteal"]
    hanging = ["-o", f"faulthandler_timeout={HANGING_S}"]
    return ["-v", "--tb=line", "-rfE", "-p", "no:cacheprovider", *hanging, *parallel]


def summary(told: str, *, cut: bool) -> list[Row]:
    """What pytest printed, as rows; what it says of single tests holds however it ended."""
    counts: Counter[str] = Counter()
    failures = []
    for found in OUTCOME.finditer(told):
        word, name = found["word"] or found["plain_word"], found["name"] or found["plain"]
        counts[word.lower()] += 1
        if word in ("FAILED", "ERROR"):
            failures.append(name.strip())
    reasons = dict(re.findall(r"^(?:FAILED|ERROR) (\S.*?) - (.*)$", told, re.MULTILINE))
    first: Row = {name: counts[name] for name in ("passed", "failed", "error", "skipped")}
    if cut:
        first["failure"] = "time was up before the last test"
    elif not counts:
        first["failure"] = f"pytest ended early: {_last_line(told)}"
    rows: list[Row] = [
        {"failure": f"{name}: {reasons.get(name, 'no reason was told')}"[:300]}
        for name in failures[:MOST_FAILURES]
    ]
    return [first, *rows]


def _last_line(told: str) -> str:
    lines = [line for line in told.splitlines() if line.strip()]
    return lines[-1][:300] if lines else "no output"
