"""Run everything that a GPU can tell: `python -m tests.on_device [PYTEST FLAGS]`.

Finds the GPU's driver, measures, compares pictures with the ones that `--reference` rendered on
PoCL, and runs tests, in order of value. A row of figures is appended to
`out/on_device/results.jsonl` as soon as it is known. A driver that crashes or hangs ends one test:
pytest-xdist starts another process. `IPRT_TEST_DEVICE` names another device.
"""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.on_device import drivers
from tests.on_device.conftest import OUT, ROOT

HANGING_S = 90
"""Seconds after which a test hangs."""
UNCACHED = {"PYOPENCL_NO_CACHE": "1", "CUDA_CACHE_DISABLE": "1", "NEO_CACHE_PERSISTENT": "0"}
"""Drivers build programs anew."""
MEASURED = ("properties", "speed", "frames", "model", "times", "workers", "builds")
TESTED = ("kernels", "filter", "view", "world")


def main(*flags: str) -> int:
    """Run the command; return pytest's exit status, or 3 without a device."""
    if "--reference" in flags:
        from tests.on_device.frames import write_reference

        write_reference()
        return 0
    device = os.environ.setdefault("IPRT_TEST_DEVICE", "gpu")
    OUT.mkdir(parents=True, exist_ok=True)
    os.chdir(ROOT)
    os.environ |= UNCACHED
    with TemporaryDirectory() as folder:
        drivers.install_here(Path(folder))
        drivers.describe_gpu()
        found = drivers.find_opencl(Path(folder), needs_gpu=device == "gpu")
        drivers.find_egl()
        if not found.get("devices"):
            return 3
        files = [f"tests/on_device/{name}.py" for name in MEASURED]
        files += [f"tests/{name}" for name in TESTED]
        process = ["-n1"] if find_spec("xdist") else []
        hanging = [f"faulthandler_timeout={HANGING_S}", "faulthandler_exit_on_timeout=true"]
        options = [word for option in hanging for word in ("-o", option)]
        words = ["-v", "--tb=short", "-p", "no:cacheprovider", *options, *process, *flags, *files]
        return int(pytest.main(words))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
