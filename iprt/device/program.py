"""Programs: files of `cl/` built with one set of defines."""

from __future__ import annotations

import re
import time
import warnings
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyopencl as cl

from iprt.device.signature import Parameter, signature
from iprt.errors import KernelError
from iprt.files.resources import CL

Define = int | float | bool | str

CACHE_RACE = "unable to rename temporary"
"""In the log of a build while another process put the same program into PoCL's cache."""
BUILD_TRIES, BUILD_PAUSE_S = 4, 0.2
"""How often such a build is tried, and the seconds in between."""


@dataclass(frozen=True, eq=False)
class Program:
    """A built program.

    Attributes
    ----------
    name : str
        Its name in the profile.
    built : pyopencl.Program
    file : str
    options : tuple of str
        What the compiler was given.
    kernels : weak set of Kernel
        Those that are in use.
    """

    name: str
    built: Any
    file: str
    options: tuple[str, ...]
    kernels: weakref.WeakSet[Any] = field(default_factory=weakref.WeakSet)
    _signatures: dict[str, tuple[Parameter, ...]] = field(default_factory=dict)

    def signature(self, kernel: str) -> tuple[Parameter, ...]:
        """Parameters of one of its kernels, in order."""
        if kernel not in self._signatures:
            defines = (option[2:].split("=") for option in self.options if option.startswith("-D"))
            source = (CL / self.file).read_text()
            self._signatures[kernel] = signature(source, kernel, dict(defines), CL / "lib")
        return self._signatures[kernel]


def build(context: cl.Context, file: str, options: Sequence[str], tries: int = BUILD_TRIES) -> Any:
    """The program of `cl/<file>` for the only device of a context.

    Raises
    ------
    KernelError
        It did not build.
    """
    source = (CL / file).read_text()
    try:
        with warnings.catch_warnings():
            # Some compilers report success at length; a failure raises with its log.
            warnings.simplefilter("ignore", cl.CompilerWarning)
            return cl.Program(context, source).build(list(options))
    except cl.RuntimeError as error:
        if tries > 1 and CACHE_RACE in str(error):
            time.sleep(BUILD_PAUSE_S)
            return build(context, file, options, tries - 1)
        raise KernelError(_report(context.devices[0], file, options, str(error))) from error


def _report(device: cl.Device, file: str, options: Sequence[str], message: str) -> str:
    # pyopencl puts the routine's name before the compiler's log, and options after it.
    log = re.sub(
        r"\A.*?Build on <[^\n]*>:|^\((options|source saved).*?\)$", "", message, flags=re.S | re.M
    )
    return (
        f"cl/{file} did not build\n"
        f"  device   {device.name.strip()} ({device.platform.name.strip()})\n"
        f"  driver   {device.driver_version.strip()}\n"
        f"  options  {' '.join(options)}\n"
        f"{log.strip()}"
    )


def variant(file: str, defines: Mapping[str, Define] | None) -> tuple[str, list[str]]:
    """A program's name and its compiler's options."""
    flags = [
        f"-D{define}={_literal(value)}"
        for define, value in sorted((defines or {}).items())
        if value is not False
    ]
    options = ["-cl-std=CL1.2", "-cl-kernel-arg-info", "-I", str(CL / "lib"), *flags]
    return " ".join([file, *flags]), options


def _literal(value: Define) -> str:
    if isinstance(value, bool):
        return "1"
    if isinstance(value, float):
        return f"{np.float32(value)!s}f" if "." in str(np.float32(value)) else f"{value!r}f"
    return str(value)
