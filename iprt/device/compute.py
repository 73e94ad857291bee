"""An OpenCL device with its programs and kernels."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import pyopencl as cl

from iprt.device.bands import Bands
from iprt.device.buffers import BufferDevice
from iprt.device.compilers import Compilers
from iprt.device.kernel import Kernel
from iprt.device.program import Define, PlannedKernel, Program, build


@dataclass(eq=False)
class _Built:
    """A program and its kernels in use.

    Attributes
    ----------
    built : object or None
        Result of `build`. None until a kernel is launched.
    """

    program: Program
    built: Any = None
    kernels: weakref.WeakSet[Kernel] = field(default_factory=weakref.WeakSet)


class ComputeDevice(BufferDevice):
    """Programs and kernels on one OpenCL device, with the buffers that they share.

    Attributes
    ----------
    building : callable
        Called with the name of a file of `cl/` before the program is built and before a kernel's
        first launch. Both may take seconds.
    bands : Bands or None
        Launches kernels in parts, between which work can be abandoned. None: as a whole.
    most_programs : int or None
        Limit of built programs, beyond which unused ones are released. None: no limit.
    """

    def __init__(self, device: cl.Device, limit_s: float | None = None) -> None:
        super().__init__(device, limit_s)
        self.building: Callable[[str], None] = lambda file: None
        self.bands: Bands | None = None
        self.most_programs: int | None = None
        self._programs: dict[Program, _Built] = {}  # least recently used first
        self._launched: set[tuple[str, str]] = set()
        self._compilers = Compilers.of(device)

    def group_size(self, dimensions: int) -> tuple[int, ...]:
        """Return the work-group size. It is fixed, so that PoCL compiles each kernel once.

        Kernels in three dimensions work on tiles (`iprt.gbuffer.tiles`). A group of a CPU is part
        of one, or has four in lanes: of fewer, larger groups some threads would get none.
        """
        if dimensions == 1:
            return (64,) if self.is_cpu else (128,)
        if dimensions == 2:
            return (64, 1) if self.is_cpu else (16, 8)
        return (16, 4, 1) if self.is_cpu else (16, 8, 1)

    def kernel(
        self,
        file: str,
        name: str,
        defines: Mapping[str, Define] | None = None,
        *,
        items: int = 0,
        later: bool = False,
    ) -> Kernel:
        """Return kernel `name` of `cl/<file>`. It is built at its first launch.

        Parameters
        ----------
        file, name : str
        defines : mapping of str to int, float, bool or str, optional
            Macros, given to the compiler by `-D`; False omits one.
        items : int, optional
            Largest grid dimension of its launches, if that may exceed
            `iprt.device.compilers.SMALL_GRID`.
        later : bool, optional
            The first picture does not need the kernel.
        """
        program = Program.of(file, defines)
        self.compile([PlannedKernel(file, name, defines or {}, items, later)])
        found = self._programs.pop(program, None) or _Built(program)
        self._programs[found.program] = found
        kernel = Kernel(
            self,
            lambda: cl.Kernel(self._built(found, name), name),
            name,
            found.program.name,
            program.signature(name),
        )
        found.kernels.add(kernel)
        self._forget_programs()
        return kernel

    def compile(self, kernels: Iterable[PlannedKernel], *, later: bool = False) -> None:
        """Begin to compile kernels in the background, if the driver allows it.

        Parameters
        ----------
        kernels : iterable of PlannedKernel
        later : bool, optional
            Include kernels that the first picture does not need.
        """
        if self._compilers is not None:
            for kernel in kernels:
                if later or not kernel.later:
                    program = Program.of(kernel.file, kernel.defines)
                    self._compilers.request(program, kernel.name, kernel.items)

    def _built(self, found: _Built, kernel: str) -> Any:
        """Build a program once, after waiting for the background compilation of the kernel.

        Raises
        ------
        KernelError
            It does not build.
        """
        name = found.program.name
        if found.built is None:
            self.building(found.program.file)
        if found.built is None or (name, kernel) not in self._launched:
            with self.profile.compiling(name):
                if self._compilers is not None:
                    self._compilers.wait(found.program, kernel)
                found.built = found.built or build(self.context, found.program)
        return found.built

    def to_compile(self, kernels: Iterable[PlannedKernel]) -> int:
        """Count the compilations that these kernels still need.

        A program that is not built counts one, and so does a kernel that was never launched.
        """
        missing = set()
        for kernel in kernels:
            program = Program.of(kernel.file, kernel.defines)
            found = self._programs.get(program)
            if found is None or found.built is None:
                missing.add((program, ""))
            if found is None or (found.program.name, kernel.name) not in self._launched:
                missing.add((program, kernel.name))
        return len(missing)

    def _forget_programs(self) -> None:
        """Release unused programs beyond `most_programs`, least recently used first."""
        for program, found in list(self._programs.items()):
            if self.most_programs is None or len(self._programs) <= self.most_programs:
                return
            if not found.kernels:
                del self._programs[program]
                self._launched -= {known for known in self._launched if known[0] == program.name}

    def is_first_launch(self, program: str, kernel: str) -> bool:
        """Return True at the first call for this kernel, False later."""
        first = (program, kernel) not in self._launched
        self._launched.add((program, kernel))
        return first

    @property
    def built_programs(self) -> list[Program]:
        """Programs of the kernels made so far."""
        return list(self._programs)
