"""OpenCL programs: files of `cl/` with a set of defines."""

from __future__ import annotations

import hashlib
import re
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pyopencl as cl
from pyopencl.cache import create_built_program_from_source_cached
from pyopencl.characterize import has_src_build_cache

from iprt.device.kernel_source import resolved
from iprt.device.signature import Parameter, dimensions, signature
from iprt.errors import KernelError
from iprt.files.resources import CL

Define = int | float | bool | str
OPTIONS = ("-cl-std=CL1.2", "-cl-kernel-arg-info")

CACHE_RACE = "unable to rename temporary"
"""Text in the build log if another process wrote the same program to PoCL's cache meanwhile."""
BUILD_TRIES, BUILD_PAUSE_S = 4, 0.2
"""Number of tries of such a build, and seconds between them."""


class PlannedKernel(NamedTuple):
    """Description of a kernel before it is built; see `ComputeDevice.kernel`."""

    file: str
    name: str
    defines: Mapping[str, Define]
    items: int = 0
    later: bool = False


@dataclass(frozen=True)
class Program:
    """A program before it is built. Equal programs are compiled once.

    Attributes
    ----------
    text : str
        OpenCL C; see `iprt.device.kernel_source.resolved`.
    options : tuple of str
        Compiler options, with the defines that occur in the text.
    file : str
        Path below `cl/`.
    name : str
        Name in the profile: file and defines.
    """

    text: str
    options: tuple[str, ...]
    file: str = field(compare=False)
    name: str = field(compare=False)

    @classmethod
    def of(cls, file: str, defines: Mapping[str, Define] | None = None) -> Program:
        """Return the program of `cl/<file>`; `defines` that are False are omitted."""
        return _program(file, None, _literals(defines or {}))

    @classmethod
    def of_text(cls, text: str, name: str, defines: Mapping[str, Define] | None = None) -> Program:
        """Return the program of OpenCL C source, which may include files of `cl/`."""
        return _program(name, text, _literals(defines or {}))

    def signature(self, kernel: str) -> tuple[Parameter, ...]:
        """Return the parameters of a kernel, in order."""
        return _signature(self.text, kernel)

    def dimensions(self, kernel: str) -> int:
        """Return the dimensions of a kernel's grid, of which 1 counts as 2."""
        return dimensions(self.text, kernel)

    @property
    def key(self) -> str:
        """Hash of text and options."""
        return hashlib.sha256("\0".join([self.text, *self.options]).encode()).hexdigest()


@cache
def _program(file: str, text: str | None, defines: tuple[tuple[str, str], ...]) -> Program:
    text = (CL / file).read_text() if text is None else text
    source = resolved(text, file, dict(defines), CL)
    words = set(re.findall(r"\w+", source))
    flags = [f"-D{name}={value}" for name, value in defines if name in words]
    name = " ".join([file, *(f"-D{name}={value}" for name, value in defines)])
    return Program(source, (*OPTIONS, *flags), file, name)


_signature = cache(signature)


def device_key(device: cl.Device) -> str:
    """Return a text that tells devices, and versions of their drivers, apart."""
    return "\0".join([device.name, device.driver_version, device.version])


def build(context: cl.Context, program: Program, tries: int = BUILD_TRIES) -> Any:
    """Build a program for the only device of a context; returns what `pyopencl.Kernel` takes.

    Raises
    ------
    KernelError
        The program does not build.
    """
    try:
        with warnings.catch_warnings():
            # Some compilers log a lot on success; a failure raises with its log.
            warnings.simplefilter("ignore", cl.CompilerWarning)
            # `cl.Program.build` would add the folder of pyopencl's headers to the options and so to
            # the driver's cache key: every Python environment would compile the program again.
            return create_built_program_from_source_cached(
                context,
                program.text,
                " ".join(program.options).encode(),
                cache_dir=False if has_src_build_cache(context.devices[0]) else None,
            )[0]
    except cl.RuntimeError as error:
        if tries > 1 and CACHE_RACE in str(error):
            time.sleep(BUILD_PAUSE_S)
            return build(context, program, tries - 1)
        raise KernelError(_report(context.devices[0], program, str(error))) from error


def _report(device: cl.Device, program: Program, message: str) -> str:
    # pyopencl puts the routine's name before the compiler's log and the options after it.
    log = re.sub(
        r"\A.*?Build on <[^\n]*>:|^\((options|source saved).*?\)$", "", message, flags=re.S | re.M
    )
    return (
        f"cl/{program.file} did not build\n"
        f"  device   {device.name.strip()} ({device.platform.name.strip()})\n"
        f"  driver   {device.driver_version.strip()}\n"
        f"  options  {' '.join(program.options)}\n"
        f"{log.strip()}"
    )


def _literals(defines: Mapping[str, Define]) -> tuple[tuple[str, str], ...]:
    given = sorted(defines.items())
    return tuple((name, _literal(value)) for name, value in given if value is not False)


def _literal(value: Define) -> str:
    if isinstance(value, bool):
        return "1"
    if isinstance(value, float):
        return f"{np.float32(value)!s}f" if "." in str(np.float32(value)) else f"{value!r}f"
    return str(value)
