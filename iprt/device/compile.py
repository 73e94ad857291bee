"""Worker process of `iprt.device.compilers`.

`python -m iprt.device.compile PLATFORM DEVICE` reads tasks from stdin, one line of JSON each: the
text and options of a program, and a list of `KernelTask`. It answers `true` for each compiled
kernel, and `false` for a program that does not build.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any

import numpy as np
import pyopencl as cl

from iprt.device.compilers import POCL, SMALL_GRID, KernelTask
from iprt.device.program import Program, build
from iprt.errors import KernelError

GROUPS = {2: (64, 1), 3: (16, 4, 1)}
"""Work groups by dimensions: `ComputeDevice.group_size` on a CPU. PoCL compiles for one of them."""
MEMORY_BYTES = 2**21
"""Size of the zeroed memory of a launch. All its buffers point to the middle."""


def launch(context: cl.Context, built: Any, task: KernelTask) -> None:
    """Launch a kernel with zeros in all arguments and buffers, so that it has no work to do."""
    queue = cl.CommandQueue(context)
    memory = cl.Buffer(context, cl.mem_flags.READ_WRITE, MEMORY_BYTES)
    cl.enqueue_fill_buffer(queue, memory, b"\0", 0, MEMORY_BYTES)
    middle = memory.get_sub_region(MEMORY_BYTES // 2, MEMORY_BYTES // 2)
    kernel = cl.Kernel(built, task.name)
    for index, components in enumerate(task.components):
        kernel.set_arg(index, np.zeros(components, np.int32) if components else middle)
    group = GROUPS[task.dimensions]
    groups = -(-SMALL_GRID // group[0]) if task.large else 1
    cl.enqueue_nd_range_kernel(queue, kernel, (groups * group[0], *group[1:]), group).wait()


def main() -> None:
    """Compile tasks until stdin ends."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # drivers print to stdout
    platform, device = map(int, sys.argv[1:])
    driver = cl.get_platforms()[platform]
    context = cl.Context([driver.get_devices()[device]])
    for line in sys.stdin:
        text, options, kernels = json.loads(line)
        try:
            built = build(context, Program(text, tuple(options), "", ""))
        except KernelError:  # the parent process reports it at the launch
            built = None
        for task in kernels if built is not None else ():
            if driver.name.strip() == POCL:
                launch(context, built, KernelTask(*task))
            answers.write("true\n")
            answers.flush()
        if built is None:
            answers.write("false\n")
            answers.flush()


if __name__ == "__main__":
    main()
