"""Processes that fill the cache of compiled programs, one per core.

PoCL and Intel's runtime compile one program at a time in a process, however many threads ask. What
Intel's runtime builds, pyopencl keeps. PoCL compiles a kernel when it is first launched: a process
of its own launches it on a few items, and the launch here finds it compiled.
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
from iprt.device.program import Program

POCL, INTEL = "Portable Computing Language", "Intel(R) OpenCL"
"""Names of the platforms that these processes compile for."""
SMALL_GRID = 2**16 - 1
"""Most items along a dimension up to which PoCL compiles a kernel for small grids."""
MOST_PROCESSES = 8
IDLE_S = 2.0
"""Seconds after which a process without work ends."""
LONGEST_S = 300.0
"""Longest wait for a process; after it, the kernel is compiled at its launch here."""


class KernelTask(NamedTuple):
    """A kernel to compile.

    Attributes
    ----------
    name : str
    components : list of int
        Of each parameter, of four bytes each; 0: a buffer.
    large : bool
        For grids larger than `SMALL_GRID`.
    """

    name: str
    components: list[int]
    large: bool


@dataclass(eq=False)
class _Task:
    """A program with kernels to compile."""

    program: Program
    kernels: list[KernelTask] = field(default_factory=list)
    done: threading.Event = field(default_factory=threading.Event)


class Compilers:
    """Compiles kernels of one device in other processes, in the order of the requests.

    Parameters
    ----------
    device : pyopencl.Device
    processes : int
        Number that work at the same time.
    """

    def __init__(self, device: cl.Device, processes: int) -> None:
        platforms = cl.get_platforms()
        platform = platforms.index(device.platform)
        self._place = (platform, platforms[platform].get_devices().index(device))
        self._device_key = "\0".join([device.name, device.driver_version, device.version])
        self._folder = _pocl_cache() / "iprt"
        self._processes = processes
        self._changed = threading.Condition()
        self._queue: deque[_Task] = deque()
        self._tasks: dict[tuple[Program, str, bool], _Task] = {}
        self._running = 0

    @classmethod
    def of(cls, device: cl.Device) -> Compilers | None:
        """Return the compilers of a device, or None where its driver gains nothing by them."""
        processes = min(len(os.sched_getaffinity(0)), MOST_PROCESSES)
        cached = {
            POCL: os.environ.get("POCL_KERNEL_CACHE", "1") != "0",
            INTEL: "PYOPENCL_NO_CACHE" not in os.environ,
        }
        useful = cached.get(device.platform.name.strip(), False) and processes > 1
        return cls(device, processes) if useful else None

    def request(self, program: Program, kernel: str, items: int) -> None:
        """Compile a kernel that will be launched on up to `items` along a dimension.

        Returns at once. Does nothing where the kernel is in the cache. One that is compiled for
        large grids serves small ones too.
        """
        large = items > SMALL_GRID
        key = (program, kernel, large)
        asked = key in self._tasks or (program, kernel, True) in self._tasks
        if asked or self._file(*key).exists():
            return
        components = [parameter.components for parameter in program.signature(kernel)]
        with self._changed:
            task = next((task for task in self._queue if task.program == program), None)
            if task is None:
                task = _Task(program)
                self._queue.append(task)
            task.kernels.append(KernelTask(kernel, components, large))
            self._tasks[key] = task
            if self._running < min(self._processes, len(self._queue)):
                self._running += 1
                threading.Thread(target=self._work, daemon=True).start()
            self._changed.notify()

    def wait(self, program: Program, kernel: str) -> None:
        """Wait for a kernel, if it was requested, and move it to the front of the queue."""
        for large in (False, True):
            task = self._tasks.get((program, kernel, large))
            if task is not None:
                with self._changed:
                    if task in self._queue:
                        self._queue.remove(task)
                        self._queue.appendleft(task)
                task.done.wait(LONGEST_S)

    def _work(self) -> None:
        """Hand tasks to a process, until there have been none for a while."""
        process: subprocess.Popen[bytes] | None = None
        while (task := self._next()) is not None:
            kernels = deque(task.kernels)
            while kernels:
                process = process or self._start()
                if not self._compile(process, task.program, kernels):
                    process = None
            task.done.set()
        if process is not None:
            process.communicate()  # it ends with its input

    def _next(self) -> _Task | None:
        with self._changed:
            if not self._queue:
                self._changed.wait(IDLE_S)
            if self._queue:
                return self._queue.popleft()
            self._running -= 1
            return None

    def _start(self) -> subprocess.Popen[bytes]:
        """Start a process of `iprt.device.compile`, which finds the package where this one did."""
        folders = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
        return subprocess.Popen(
            [sys.executable, "-m", "iprt.device.compile", *map(str, self._place)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(folders)},
            start_new_session=True,  # Ctrl+C is for this process, whose end ends the other
        )

    def _compile(
        self, process: subprocess.Popen[bytes], program: Program, kernels: deque[KernelTask]
    ) -> bool:
        """Compile kernels, which leave the list; return whether the process goes on."""
        try:
            task = [program.text, program.options, list(kernels)]
            _stream(process.stdin).write(json.dumps(task).encode() + b"\n")
            _stream(process.stdin).flush()
            while kernels:
                if json.loads(_stream(process.stdout).readline()):
                    self._mark(program, kernels.popleft())
                else:  # reported where it is launched
                    kernels.clear()
        except (OSError, ValueError):
            # With nothing to work on, a kernel may crash; by then it is compiled.
            process.kill()
            process.wait()
            self._mark(program, kernels.popleft())
            return False
        return True

    def _mark(self, program: Program, kernel: KernelTask) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        self._file(program, kernel.name, kernel.large).touch()

    def _file(self, program: Program, kernel: str, large: bool) -> Path:
        """Return the file that stands for a compiled kernel."""
        words = [self._device_key, program.key, kernel, str(large)]
        return self._folder / hashlib.sha256("\0".join(words).encode()).hexdigest()


def _stream(pipe: IO[bytes] | None) -> Any:
    assert pipe is not None
    return pipe


def _pocl_cache() -> Path:
    own = os.environ.get("POCL_CACHE_DIR")
    return Path(own) if own else (cache_folder() or Path(os.devnull)) / "pocl" / "kcache"
