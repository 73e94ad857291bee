"""Worker processes that fill the kernel cache, one per core.

PoCL and Intel's runtime compile one program at a time per process, regardless of threads. pyopencl
caches the programs that Intel's runtime builds. PoCL compiles a kernel at its first launch: a
worker launches it on a few work items, and the launch in this process finds it in the cache.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import threading
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NamedTuple

import pyopencl as cl

from iprt.device.caches import cache_folder
from iprt.device.program import Program, device_key

POCL, INTEL = "Portable Computing Language", "Intel(R) OpenCL"
"""Names of the supported platforms."""
SMALL_GRID = 2**16 - 1
"""Largest grid dimension for which PoCL compiles a kernel's variant for small grids."""
MOST_PROCESSES = 8
IDLE_S = 2.0
"""Seconds without work after which a worker ends."""
LONGEST_S = 300.0
"""Longest wait for a worker. After it, this process compiles the kernel at its launch."""


class KernelTask(NamedTuple):
    """A kernel to compile.

    Attributes
    ----------
    name : str
    components : list of int
        Four-byte components of each parameter; 0: a buffer.
    dimensions : int
        2 or 3, of its grid.
    large : bool
        Compile for grids larger than `SMALL_GRID`.
    """

    name: str
    components: list[int]
    dimensions: int
    large: bool


@dataclass(eq=False)
class _Task:
    """A program with kernels to compile."""

    program: Program
    kernels: list[KernelTask] = field(default_factory=list)
    done: threading.Event = field(default_factory=threading.Event)


class Compilers:
    """Pool of worker processes that compile kernels for one device, in the order of the requests.

    Parameters
    ----------
    device : pyopencl.Device
    processes : int
        Largest number of concurrent workers.
    """

    def __init__(self, device: cl.Device, processes: int) -> None:
        platforms = cl.get_platforms()
        platform = platforms.index(device.platform)
        self._place = (platform, platforms[platform].get_devices().index(device))
        self._device_key = device_key(device)
        self._folder = _pocl_cache() / "iprt"
        self._processes = processes
        self._changed = threading.Condition()
        self._queue: deque[_Task] = deque()
        self._tasks: dict[tuple[Program, str, bool], _Task] = {}
        self._running = 0

    @classmethod
    def of(cls, device: cl.Device) -> Compilers | None:
        """Return the compilers of a device, or None if they would not speed up its driver."""
        processes = min(len(os.sched_getaffinity(0)), MOST_PROCESSES)
        cached = {
            POCL: os.environ.get("POCL_KERNEL_CACHE", "1") != "0",
            INTEL: "PYOPENCL_NO_CACHE" not in os.environ,
        }
        useful = cached.get(device.platform.name.strip(), False) and processes > 1
        return cls(device, processes) if useful else None

    def request(self, program: Program, kernel: str, items: int) -> None:
        """Request a kernel that will be launched on up to `items` work items per dimension.

        Returns at once. Does nothing if the kernel is in the cache. A kernel compiled for large
        grids serves small ones too.
        """
        large = items > SMALL_GRID
        key = (program, kernel, large)
        asked = key in self._tasks or (program, kernel, True) in self._tasks
        if asked or self._file(*key).exists():
            return
        components = [parameter.components for parameter in program.signature(kernel)]
        dimensions = program.dimensions(kernel)
        with self._changed:
            task = next((task for task in self._queue if task.program == program), None)
            if task is None:
                task = _Task(program)
                self._queue.append(task)
            task.kernels.append(KernelTask(kernel, components, dimensions, large))
            self._tasks[key] = task
            if self._running < min(self._processes, len(self._queue)):
                self._running += 1
                threading.Thread(target=self._work, daemon=True).start()
            self._changed.notify()

    def wait(self, program: Program, kernel: str) -> None:
        """Move a requested kernel to the front of the queue and wait for it."""
        for large in (False, True):
            task = self._tasks.get((program, kernel, large))
            if task is not None:
                with self._changed:
                    if task in self._queue:
                        self._queue.remove(task)
                        self._queue.appendleft(task)
                task.done.wait(LONGEST_S)

    def _work(self) -> None:
        """Feed tasks to a worker until none arrives for `IDLE_S`."""
        process: subprocess.Popen[bytes] | None = None
        while (task := self._next()) is not None:
            kernels = deque(task.kernels)
            while kernels:
                process = process or self._start()
                if not self._compile(process, task.program, kernels):
                    process = None
            task.done.set()
        if process is not None:
            process.communicate()  # closes its stdin, which ends it

    def _next(self) -> _Task | None:
        with self._changed:
            if not self._queue:
                self._changed.wait(IDLE_S)
            if self._queue:
                return self._queue.popleft()
            self._running -= 1
            return None

    def _start(self) -> subprocess.Popen[bytes]:
        """Start `iprt.device.compile` with this process's copy of the package."""
        folders = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
        return subprocess.Popen(
            [sys.executable, "-m", "iprt.device.compile", *map(str, self._place)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(folders)},
            start_new_session=True,  # Ctrl+C reaches only this process; its end ends the worker
        )

    def _compile(
        self, process: subprocess.Popen[bytes], program: Program, kernels: deque[KernelTask]
    ) -> bool:
        """Compile `kernels` and remove them; return True if the worker still runs."""
        try:
            task = [program.text, program.options, list(kernels)]
            _stream(process.stdin).write(json.dumps(task).encode() + b"\n")
            _stream(process.stdin).flush()
            while kernels:
                if json.loads(_stream(process.stdout).readline()):
                    self._mark(program, kernels.popleft())
                else:  # reported at the launch
                    kernels.clear()
        except (OSError, ValueError):
            # A kernel may crash on the empty input. It has been compiled by then.
            process.kill()
            process.wait()
            self._mark(program, kernels.popleft())
            return False
        return True

    def _mark(self, program: Program, kernel: KernelTask) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        self._file(program, kernel.name, kernel.large).touch()

    def _file(self, program: Program, kernel: str, large: bool) -> Path:
        """Return the path of the marker file of a compiled kernel."""
        words = [self._device_key, program.key, kernel, str(large)]
        return self._folder / hashlib.sha256("\0".join(words).encode()).hexdigest()


def _stream(pipe: IO[bytes] | None) -> Any:
    assert pipe is not None
    return pipe


def _pocl_cache() -> Path:
    own = os.environ.get("POCL_CACHE_DIR")
    return Path(own) if own else (cache_folder() or Path(os.devnull)) / "pocl" / "kcache"
