"""Compiled programs that are kept from process to process.

PoCL finds the kernels of a program in its cache, but takes as long as a short compilation to read
the program itself. It reads the binary of a program in a seventh of that time.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pyopencl as cl

from iprt.device.compilers import POCL
from iprt.device.kept import Arrays, kept
from iprt.device.program import Program, build, device_key


def build_kept(context: cl.Context, program: Program) -> Any:
    """Build a program as `build` does, with PoCL from the binary of an earlier process if any.

    Raises
    ------
    KernelError
        The program does not build.
    """
    device = context.devices[0]
    if device.platform.name.strip() != POCL:
        return build(context, program)
    built = None

    def make() -> Arrays:
        nonlocal built
        built = build(context, program)
        (binary,) = built.get_info(cl.program_info.BINARIES)
        return {"binary": np.frombuffer(binary, np.uint8)}

    of = [device_key(device), program.text, program.options]
    binary = kept("program", __name__, of, make)["binary"].tobytes()
    if built is None:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", cl.CompilerWarning)
                built = cl.Program(context, [device], [binary]).build(list(program.options))
        except cl.Error:  # made by a driver that tells the same version
            built = build(context, program)
    return built
