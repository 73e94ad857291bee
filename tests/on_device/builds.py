"""How long programs take to build, and what their kernels need, as the driver itself says."""

from __future__ import annotations

import os
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
import pyopencl as cl

from iprt.commands.views import choose_view
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from iprt.device.program import Program
from iprt.film import footage_of
from iprt.memory import RenderPlan
from iprt.settings.model import Settings
from tests.gpu import Need, allocated, budgets
from tests.on_device.cases import Asked, Cases, Row
from tests.on_device.frames import first_frame, opened, scenes

VERBOSE = "-cl-nv-verbose"
THREADS = 8
DEMO = "lounge"


def cases(asked: Asked) -> Cases:
    """A program each, those of the demo first, and these in threads."""
    os.environ["POCL_CACHE_DIR"] = tempfile.mkdtemp(prefix="on-device-")
    device = ComputeDevice(choose_device(asked.device))
    demo = _planned(device, DEMO)
    programs = dict(demo)
    for name in scenes():
        programs |= _planned(device, name)
    seconds: dict[str, float] = {}

    def build(name: str) -> list[Row]:
        start = time.perf_counter()
        rows = built(device, programs[name])
        seconds[name] = time.perf_counter() - start
        return [
            {"build ms": 1e3 * seconds[name] if index == 0 else None, **row}
            for index, row in enumerate(rows)
        ]

    def together() -> list[Row]:
        start = time.perf_counter()
        with ThreadPoolExecutor(THREADS) as pool:
            list(pool.map(lambda name: built(device, programs[name]), seconds))
        wall = time.perf_counter() - start
        return [
            {
                "programs": len(seconds),
                "threads": THREADS,
                "build ms": 1e3 * wall,
                "one by one ms": 1e3 * sum(seconds.values()),
            }
        ]

    own = {name: (lambda name=name: build(name)) for name in programs}
    first = {name: own[name] for name in demo}
    return {**first, f"all of these, {THREADS} threads": together, **own}


def _planned(device: ComputeDevice, name: str) -> dict[str, Program]:
    """Programs that the views of a scene build by default, by name."""
    scene, frame, settings = opened(name), first_frame(name), Settings()
    footage = footage_of(scene, frame, settings)
    found: dict[str, Program] = {}
    for of_view in (*scene.views, "equirect"):
        view, objects = choose_view(scene, of_view)
        plan = RenderPlan.of(frame, objects, view, settings, footage, is_cpu=device.is_cpu)
        for kernel in plan.kernels:
            program = Program.of(kernel.file, kernel.defines)
            found[program.name] = program
    return found


def built(device: ComputeDevice, of: Program) -> list[Row]:
    """Build a program anew; a row for each of its kernels."""
    nvidia = "nvidia" in device.device.vendor.lower()
    asked = [*of.options, *([VERBOSE] if nvidia else [])]
    # The number makes it another program for caches that cannot be switched off.
    source = f"// {time.perf_counter_ns()}\n{of.text}"
    program = cl.Program(device.context, source).build(asked)
    log = program.get_build_info(device.device, cl.program_build_info.LOG) or ""
    needs = allocated(log)
    rows: list[Row] = []
    for kernel in program.all_kernels():
        name = kernel.function_name
        limit, private, lanes = (
            kernel.get_work_group_info(getattr(cl.kernel_work_group_info, what), device.device)
            for what in (
                "WORK_GROUP_SIZE",
                "PRIVATE_MEM_SIZE",
                "PREFERRED_WORK_GROUP_SIZE_MULTIPLE",
            )
        )
        largest = max(int(np.prod(device.group_size(d))) for d in (1, 2))
        rows.append(
            {
                "kernel": name,
                **_needed(name, needs.get(name)),
                "largest group": limit if limit >= largest else f"{limit}: TOO SMALL for {largest}",
                "private bytes": private,
                "lanes": lanes,
            }
        )
    return rows


def _needed(kernel: str, need: Need | None) -> Row:
    """What the driver's log says, beside the budget by ptxas."""
    if need is None:
        return {"registers": "the log does not say"}
    granted = _budgets().get(kernel, _budgets()["others"])
    return {
        "registers": need.registers,
        "stack": need.stack,
        "spilled": need.spilled,
        "budget": f"{granted.registers}, {granted.stack}, {granted.spilled}",
        "verdict": "within" if need.most(granted) == granted else "MORE",
    }


@cache
def _budgets() -> dict[str, Need]:
    return budgets()["nvidia"]
