"""Coverage-guided fuzzing of everything that reads files, for a bounded time.

    python -m tests.fuzz.fuzz [--seconds 8] [--keep FOLDER] [TARGET ...]

Each target runs in a process of its own, from the seeds of `tests/fuzz/seeds.py`. What fails is
kept with a traceback: no error but the user's may come, nothing may take more than 30 seconds or
more than 2 GB. Needs `pip install -e '.[fuzz]'`.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ONE = 30
"""Seconds that a single file may take."""
MEMORY = 2048
"""MB that the process may have."""


def main() -> int:
    from tests.fuzz.seeds import TARGETS

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--seconds", type=int, default=8, help="for each target")
    parser.add_argument("--keep", type=Path, help="folder that keeps what was found, between runs")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        keep = given.keep or Path(scratch)
        targets = given.targets or TARGETS
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            clean = pool.map(lambda name: _run(name, given.seconds, keep / name), targets)
            failed = [name for name, fine in zip(targets, clean, strict=True) if not fine]
    if failed:
        print(f"fuzz: failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def _run(target: str, seconds: int, folder: Path) -> bool:
    """Fuzz one target; False if something came up, which is printed."""
    (folder / "corpus").mkdir(parents=True, exist_ok=True)
    (folder / "found").mkdir(exist_ok=True)
    words = [sys.executable, "-m", "tests.fuzz.fuzz", "--one", target, str(folder)]
    words += [f"-max_total_time={seconds}", f"-timeout={ONE}", f"-rss_limit_mb={MEMORY}"]
    words += ["-max_len=8192", "-print_final_stats=1", f"-artifact_prefix={folder / 'found'}/"]
    done = subprocess.run(words, capture_output=True, text=True, errors="replace", check=False)
    runs = [line for line in done.stderr.splitlines() if "number_of_executed_units" in line]
    print(f"{target:9} {runs[0].split()[-1] if runs else '?'} files", flush=True)
    if done.returncode != 0:
        print(done.stdout[-4000:], done.stderr[-8000:], sep="\n", file=sys.stderr)
        for file in (folder / "found").iterdir():
            print(f"fuzz: {file}: {file.read_bytes()[:2000]!r}", file=sys.stderr)
    return done.returncode == 0


def _one(target: str, folder: Path, flags: list[str]) -> None:
    """In the process of its own: libFuzzer takes over and ends it."""
    import logging
    import warnings

    import atheris

    include = [
        "iprt.scene",
        "iprt.files.toml_text",
        "iprt.settings.overrides",
        "trimesh.exchange",
        "tomllib",
    ]
    with atheris.instrument_imports(include=include):
        from tests.fuzz.seeds import nasty, right
        from tests.fuzz.targets import Reading

    logging.disable()
    warnings.simplefilter("ignore")
    for number, data in enumerate(right(target) + nasty(target)):
        (folder / "corpus" / f"seed-{number:03}").write_bytes(data)
    reading = Reading(target)

    def read(data: bytes) -> None:
        reading(data)

    atheris.Setup([sys.argv[0], str(folder / "corpus"), *flags], read)
    atheris.Fuzz()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        _one(sys.argv[2], Path(sys.argv[3]), sys.argv[4:])
    sys.exit(main())
