"""Schedulers and workers of dask on this machine, as users start them, and films with stand-ins."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from iprt.commands.join import join_chunks
from iprt.commands.render_flags import RenderFlags
from iprt.commands.render_video import film_plan
from iprt.output.parts import Parts
from tests.waiting import DEADLINE_S, ROOT, until

STANDIN = Path(__file__).with_name("standin")
FRAMES, CHUNK = 40, 8
CHUNKS = FRAMES // CHUNK
FLAGS = [f"--chunk={CHUNK}", "--progress=lines"]


def words(scene: Path, output: Path, where: object, *more: str) -> list[str]:
    """The words of `iprt` that render a film on a cluster."""
    return ["render", str(scene), f"--output={output}", *FLAGS, f"--cluster={where}", *more]


def environment(**variables: object) -> dict[str, str]:
    """This process's environment for those whose renders are stand-ins."""
    given = {name: str(value) for name, value in variables.items()}
    return {**os.environ, "PYTHONPATH": str(STANDIN), **given}


def rendered_alone(scene: Path, output: Path) -> None:
    """Render all chunks in one process, one after another."""
    plan = film_plan(RenderFlags(output=output, chunk=CHUNK).job(scene))
    Parts(output).open(plan)
    code = (
        "import sys; from sitecustomize import render\n"
        f"for n in {list(plan.chunks.numbers)}:\n"
        f"    render(['--output=' + {str(output)!r}, f'--chunks={{n}}'])"
    )
    subprocess.run([sys.executable, "-c", code], env=environment(), check=True, cwd=ROOT)
    join_chunks(output, plan)


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of all files in a folder, by their names."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@contextmanager
def started(*command: str, **variables: object) -> Iterator[subprocess.Popen[bytes]]:
    """A command of Python in a process group of its own, which is killed after the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", *command],
        env=environment(**variables),
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        process_group=0,
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait(DEADLINE_S)


@contextmanager
def scheduler(file: Path, port: int = 0) -> Iterator[subprocess.Popen[bytes]]:
    """A scheduler that writes a scheduler file."""
    file.unlink(missing_ok=True)
    options = ["--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    with started("dask", "scheduler", *options, "--scheduler-file", str(file)) as process:
        until(file.exists)
        yield process


@contextmanager
def worker(
    file: Path, name: str, *, tag: str = "iprt=1", **variables: object
) -> Iterator[subprocess.Popen[bytes]]:
    """A worker without a nanny."""
    options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--name", name]
    options += ["--resources", tag] if tag else []
    command = ("dask", "worker", "--scheduler-file", str(file), *options)
    with started(*command, **variables) as process:
        yield process


def rendering(output: Path) -> list[int]:
    """Processes that render chunks of this film for a worker."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            command = path.read_text()
            if "iprt.farm.child" in command and str(output) in command:
                found.append(int(path.parent.name))
    return found


def wait_begun(output: Path) -> None:
    """Wait until a chunk of the film is being rendered."""
    until(lambda: bool(rendering(output)), 0.05)


def wait_ended(output: Path) -> None:
    """Wait until no process renders the film any longer."""
    until(lambda: not rendering(output), 0.1)
