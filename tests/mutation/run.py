"""Plants one defect after the other in a copy of the program, and sees whether its tests fail.

    python -m tests.mutation.run [WORD ...] [--results FILE]   all mutants, or of files named so
    python -m tests.mutation.run --write [--results FILE]      the results into docs/testing.md

With --quick, only by the tests that `./run test` has without --all; with --sample N, only N of
them, drawn by a fixed seed. Results are added to FILE, and mutants that it knows are not tried
again: a run may be cut short.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from tests.mutation import kernels, sampled
from tests.mutation.docs import write_section
from tests.mutation.mutant import Mutant, read
from tests.mutation.sampled import SEED

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 300.0  # seconds: what hangs has been noticed
_FAILED = 1  # pytest's exit code for tests that fail; others say that it could not run them
_BROKEN = 2  # or the tests' modules cannot even be imported
_NONE = 5  # or there is none: with --quick, where all of a file are left out


def all_mutants() -> list[Mutant]:
    """Every mutant: the planted ones and the sampled ones."""
    return [*kernels.planted(), *sampled.mutants(ROOT)]


def _copy(target: Path) -> None:
    """The files of the checkout, as they are, without what git ignores."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, target / name)


def _fails(copy: Path, tests: tuple[str, ...], flags: Sequence[str]) -> bool:
    """Return whether a test fails in the copy."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *flags, *tests]
    # Compiled files are told apart by time in seconds, which is too coarse here. Trees that a
    # mutant has built must not be found by the next, nor by the user.
    shutil.rmtree(copy / ".cache" / "iprt", ignore_errors=True)
    environment = {
        **os.environ,
        "PYTHONDONTWRITEBYTECODE": "1",
        "XDG_CACHE_HOME": str(copy / ".cache"),
        "POCL_CACHE_DIR": os.environ.get("POCL_CACHE_DIR", str(Path.home() / ".cache/pocl/kcache")),
    }
    try:
        done = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, text=True, timeout=TIMEOUT
        )
    except subprocess.TimeoutExpired:
        return True
    if done.returncode == _NONE:
        return False
    if done.returncode > _BROKEN:  # negative: a signal ended it, as where a kernel left its buffers
        raise SystemExit(done.stdout + done.stderr)
    return done.returncode != 0


def try_all(mutants: list[Mutant], results: Path, flags: Sequence[str] = ()) -> None:
    """Try the mutants that `results` does not know, and add to it which were killed.

    `flags` go to pytest.
    """
    known: dict[str, bool] = json.loads(results.read_text()) if results.exists() else {}
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        _copy(copy)
        passing: set[tuple[str, ...]] = set()
        for mutant in mutants:
            text = read(copy, mutant)
            label = mutant.label(text)
            if label in known:
                continue
            if mutant.tests not in passing and _fails(copy, mutant.tests, flags):
                raise SystemExit(f"fails without a defect: {' '.join(mutant.tests)}")
            passing.add(mutant.tests)
            started = time.monotonic()
            (copy / mutant.file).write_text(mutant.applied(text), encoding="utf-8")
            killed = _fails(copy, mutant.tests, flags)
            (copy / mutant.file).write_text(text, encoding="utf-8")
            verdict = "killed" if killed else "SURVIVED"
            print(f"{verdict} {time.monotonic() - started:.0f} s {label}", flush=True)
            known[label] = killed
            results.write_text(json.dumps(known, indent=0))


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--results", type=Path, default=ROOT / "build" / "mutants.json")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--sample", type=int, metavar="N")
    asked = parser.parse_args()
    asked.results.parent.mkdir(parents=True, exist_ok=True)
    mutants = all_mutants()
    if asked.write:
        write_section(ROOT, mutants, json.loads(asked.results.read_text()))
        return
    words = asked.words or [""]
    chosen = [mutant for mutant in mutants if any(word in mutant.file for word in words)]
    if asked.sample is not None:
        count = min(asked.sample, len(chosen))
        drawn = random.Random(SEED).sample(range(len(chosen)), count)
        chosen = [chosen[index] for index in sorted(drawn)]
    try_all(chosen, asked.results, ("-m", "not thorough") if asked.quick else ())


if __name__ == "__main__":
    main()
