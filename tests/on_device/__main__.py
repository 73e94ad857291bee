"""All that is to be known of a GPU that is there for minutes: `python -m tests.on_device`.

Finds its driver, compares pictures with those that `--reference` made of PoCL, measures, and runs
tests. Every step is a process of its own, whose cases come in order of value; what is known is in
the files of `--output` after each. Exits with 1 if a case failed, and with 3 without a device.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType

from tests.on_device import drivers, packages
from tests.on_device.results import Results, say
from tests.on_device.runner import Step, run

HERE = "tests.on_device"
UNCACHED = {"PYOPENCL_NO_CACHE": "1", "CUDA_CACHE_DISABLE": "1", "NEO_CACHE_PERSISTENT": "0"}
STEPS = [
    Step("device", "The device", f"{HERE}.device", 30),
    Step("speed", "Bandwidth and launches", f"{HERE}.speed", 20),
    Step("frames", "Pictures beside PoCL's", f"{HERE}.frames", 100, 90),
    Step("model", "Kernels beside the model of docs/gpu.md", f"{HERE}.model", 60, 90),
    Step("times", "Frame times", f"{HERE}.times", 100),
    Step("builds", "Programs", f"{HERE}.builds", 80, environment=UNCACHED),
    Step("suite", "Tests", f"{HERE}.suite", 180, 3600),
]
LEAST_S = 8.0
"""With less than this left, no step begins."""


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--device", default="gpu", help="as for `iprt render`; default: gpu")
    parser.add_argument("--minutes", type=float, default=10.0, help="for all of it; default: 10")
    parser.add_argument("--output", type=Path, default=Path("out/on_device"), help="folder")
    parser.add_argument(
        "--reference", action="store_true", help="only render the pictures to compare with, on PoCL"
    )
    asked = parser.parse_args()
    if asked.reference:
        from tests.on_device.frames import write_reference

        write_reference()
        return 0
    signal.signal(signal.SIGTERM, _interrupt)
    scale = asked.minutes / 10.0
    steps = [replace(one, most_s=one.most_s * scale, case_s=one.case_s * scale) for one in STEPS]
    results = Results(asked.output, steps)
    try:
        with TemporaryDirectory() as folder:
            if not _prepare(results, asked.device, Path(folder)):
                return 3
            return _measure(results, asked.device, results.began_s + 60.0 * asked.minutes)
    except KeyboardInterrupt:
        say("cut off")
        return 130
    finally:
        results.write()
        say(f"{results.seconds:.0f} s; results are in {asked.output}")


def _measure(results: Results, device: str, until: float) -> int:
    """Run the steps; the exit status."""
    # At first each step has its share; then they get what others left.
    for shares in (True, False):
        for step in results.steps:
            outcome = results.outcomes[step.name]
            now = time.monotonic()
            end = min(now + step.most_s, until) if shares else until
            if outcome.finished or end - now < LEAST_S:
                continue
            say(f"== {step.title} (at {results.seconds:.0f} s, for at most {end - now:.0f})")
            run(
                step,
                outcome,
                device=device,
                until=end,
                folder=results.folder,
                ended=lambda case, step=step: results.ended(step, case),
            )
            if outcome.failed:
                say(f"  FAILED: {outcome.failed}")
            results.write()
            if step.name == "device" and not outcome.rows("properties"):
                return 3
    for step in results.steps:
        outcome = results.outcomes[step.name]
        if not outcome.finished:
            say(f"{step.title}: did not fit: {', '.join(outcome.left) or 'all of it'}")
    every = results.outcomes.values()
    return int(any(one.failed or any("problem" in d for d in one.done.values()) for one in every))


def _prepare(results: Results, device: str, folder: Path) -> bool:
    """Say what is missing, and find the driver; whether anything can be run.

    `folder` takes what processes started later find by the environment.
    """
    results.note(f"Python {sys.version.split()[0]}, {os.cpu_count()} processors")
    project = packages.project()
    extras = project["optional-dependencies"]
    assert isinstance(extras, dict)
    if packages.missing(["iprt"]) == ["iprt"]:
        packages.install_here(folder)
        path = os.environ.get("PYTHONPATH")
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [path, str(folder)]))
        results.note("iprt is not installed: taken from this checkout")
    for what, requirements in (("", project["dependencies"]), (" for the tests", extras["test"])):
        lacking = packages.missing(requirements)
        if lacking:
            results.note(f"missing{what}: {packages.advice(lacking)}")
        if any(name.startswith("pyopencl") for name in lacking):
            return False
    drivers.describe_gpu(results.note)
    found = drivers.find_opencl(results.note, folder, needs_gpu=device == "gpu")
    drivers.find_egl(results.note)
    return bool(found.get("devices"))


def _interrupt(_: int, __: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
