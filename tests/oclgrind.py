"""Every kernel under Oclgrind: `python -m tests.oclgrind [FILM... | I/N]`.

All `tests.films` by default, or the I-th of N parts of them.

Oclgrind (J. Price and S. McIntosh-Smith, "Oclgrind: An Extensible OpenCL Device Simulator", IWOCL
2015) interprets kernels and watches all memory: reads and writes out of bounds, data races, values
that nobody has written, and what OpenCL is called with. It is an OpenCL driver, so each film is
played by a process that has no other one. Exits with 1 if there is any finding.
"""

from __future__ import annotations

import functools
import json
import os
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest import mock

import numpy as np
import pyopencl.array as cla
from numpy.typing import DTypeLike, NDArray

from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.device.kernel import Kernel
from iprt.device.program import Define
from iprt.settings.model import Settings
from iprt.trace import voxels
from tests.films import entry_points, films, launches, play

LIBRARY = Path("/usr/lib/oclgrind/liboclgrind-rt-icd.so")
CORE = "liboclgrind-21.10.so"
"""The library behind LIBRARY, of the version whose fault `mended_core` knows."""
MISSING = f"Oclgrind is not installed (apt-get install oclgrind): there is no {LIBRARY}"
TIMEOUT_S = 1800.0
PREFILTERED_ROWS = 16
"""Rows of the finest level here, about as many as the films' panoramas have."""
GRID_ROWS = 4
"""Rows of the grid of E_R and of the map of shadows off screen: a quarter of the least allowed."""
VOXELS = 8
"""Resolution of all volumes here, half of the least allowed."""
ROOT = Path(__file__).resolve().parents[1]

NO_FINDING = re.compile(
    # pyopencl asks every device for properties that only some vendors know.
    r"Function: clGetDeviceInfo\s+Error: +CL_INVALID_VALUE\s+For argument 'param_name'"
)


@dataclass(frozen=True)
class Watched:
    """Results of a program.

    Attributes
    ----------
    kernels : set of str
        Kernels that it launched.
    findings : list of str
        Oclgrind's reports, each once for each line of a kernel, and why the program ended early.
    """

    kernels: set[str]
    findings: list[str]


class SimulatedDevice(ComputeDevice):
    """Oclgrind, by its name."""

    def __init__(self) -> None:
        super().__init__(choose_device("oclgrind"))

    def kernel(
        self,
        file: str,
        name: str,
        defines: Mapping[str, Define] | None = None,
        **hints: Any,
    ) -> Kernel:
        # It does not know all that LLVM's optimizer makes of a kernel.
        return super().kernel(file, name, {**(defines or {}), "WITHOUT_INLINING": True}, **hints)

    def fill_zero(self, array: cla.Array) -> None:
        # It takes what `clEnqueueFillBuffer` filled for unwritten, whatever is written there later.
        self.write(array, np.zeros(array.shape, array.dtype))

    def share(self, name: str, values: NDArray[Any]) -> cla.Array:
        # It takes the host's memory for unwritten, too.
        return self.upload(name, values)

    def zeros(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float32) -> cla.Array:
        return self.upload(name, np.zeros(shape, dtype))


@functools.cache
def mended_core() -> bytes | None:
    """Oclgrind's core without the fault that crashes its search for what nobody has written.

    A lane of a shuffle that takes from nowhere has the index -1. Oclgrind 21.10 compares indices
    with the number of LLVM's kind of value "undef", 11, instead, and reads four gigabytes off. None
    where there is another version, or no such comparison (`add %rax, %rbp; cmp $11, %ecx`).
    """
    for folder in sorted(Path("/usr/lib").glob("*-linux-gnu")):
        core = folder / CORE
        data = core.read_bytes() if core.exists() else b""
        if data.count(bytes.fromhex("4801c5 83f90b")) == 1:
            return data.replace(bytes.fromhex("4801c5 83f90b"), bytes.fromhex("4801c5 83f9ff"))
    return None


def oclgrind_environment(folder: Path, **variables: str) -> dict[str, str]:
    """Environment in which Oclgrind, registered in `folder`, is the only driver."""
    (folder / "oclgrind.icd").write_text(f"{LIBRARY}\n")
    return {
        **os.environ,
        "OCL_ICD_VENDORS": str(folder),
        "OCLGRIND_BUILD_OPTIONS": "-cl-opt-disable",
        "PYOPENCL_NO_CACHE": "1",
        **variables,
    }


def watch(program: str, cache: str | None = None) -> Watched:
    """Run Python code that prints the names of the kernels that it launched, as JSON.

    The folder `cache` keeps built programs for other runs; the reports of those name lines of
    kernels, but do not show them.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        core = mended_core()
        if core is not None:
            (folder / CORE).write_bytes(core)
        environment = oclgrind_environment(
            folder,
            OCLGRIND_CHECK_API="1",
            OCLGRIND_DATA_RACES="1",
            **({} if core is None else {"OCLGRIND_UNINITIALIZED": "1"}),
            LD_LIBRARY_PATH=os.pathsep.join(filter(None, (name, os.getenv("LD_LIBRARY_PATH")))),
            OCLGRIND_MAX_ERRORS="1000000",
            OCLGRIND_NUM_THREADS="1",
            OCLGRIND_LOG=str(folder / "log"),
            **({} if cache is None else {"XDG_CACHE_HOME": cache, "PYOPENCL_NO_CACHE": "0"}),
        )
        child = subprocess.run(
            [sys.executable, "-c", program],
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIMEOUT_S,
            check=False,
        )
        log = folder / "log"
        found = reports(log.read_text(errors="replace") if log.exists() else "")
    found += [text for text in reports(child.stderr) if text.startswith("Oclgrind")]
    if child.returncode != 0:
        lines = [line for line in child.stderr.splitlines() if line.strip()]
        found.append(f"ended with status {child.returncode}: {lines[-1] if lines else ''}")
        return Watched(set(), found)
    return Watched(set(json.loads(child.stdout.splitlines()[-1])), found)


def reports(text: str) -> list[str]:
    """The reports in a log, those alike but for work item and address once, with their number."""
    alike: dict[str, str] = {}
    number: Counter[str] = Counter()
    for report in re.split(r"\n(?=\S)", text):
        if not report.strip() or NO_FINDING.search(report):
            continue
        key = re.sub(r"0x[0-9a-f]+|\([0-9,]+\)", "", report)
        alike.setdefault(key, report.strip())
        number[key] += 1
    return [f"{report}\n\t({number[key]} of these)" for key, report in alike.items()]


def play_film(name: str) -> None:
    """Play a film on Oclgrind, in a process that `watch` has started."""
    # More bounces and larger grids cost minutes and are the same accesses.
    film = films(trace={"bounces": 2})[name]
    with launches() as names, mock.patch.object(voxels, "PREFILTERED_ROWS", PREFILTERED_ROWS):
        play(SimulatedDevice(), replace(film, settings=with_small_grids(film.settings)))
    print(json.dumps(sorted(names)))


def with_small_grids(settings: Settings) -> Settings:
    """The settings with `GRID_ROWS` and `VOXELS`, which they would refuse."""
    irradiance = settings.irradiance.model_copy(update={"rows": GRID_ROWS})
    volumes = dict.fromkeys(("voxels", "object_voxels", "room_voxels"), VOXELS)
    small = {"ratio_rows": GRID_ROWS, **volumes}
    of_methods = tuple(
        group.model_copy(update={key: small[key] for key in small if hasattr(group, key)})
        for group in settings.of_methods
    )
    return settings.model_copy(update={"irradiance": irradiance, "of_methods": of_methods})


def watch_film(name: str, cache: str) -> Watched:
    start = time.perf_counter()
    watched = watch(f"from tests.oclgrind import play_film; play_film({name!r})", cache)
    print(f"{name}: {len(watched.findings)} findings, {time.perf_counter() - start:.0f} s")
    for finding in watched.findings:
        print(finding)
    sys.stdout.flush()
    return watched


def main(names: list[str]) -> int:
    if not LIBRARY.exists():
        print(f"skipped: {MISSING}")
        return 0
    if mended_core() is None:
        print("values that nobody has written are not looked for: Oclgrind is not the known build")
    if names and "/" in names[0]:
        part, parts = map(int, names[0].split("/"))
        names = list(films())[part - 1 :: parts]
    with TemporaryDirectory() as cache, ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(functools.partial(watch_film, cache=cache), names or films()))
    kernels = set().union(*(watched.kernels for watched in results))
    unwatched = set() if names else entry_points() - kernels
    if unwatched:
        print(f"kernels that no film launches: {', '.join(sorted(unwatched))}")
    print(f"{len(kernels)} kernels under Oclgrind")
    return 1 if unwatched or any(watched.findings for watched in results) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
