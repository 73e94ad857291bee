"""Build times of programs, and the needs of their kernels, as the driver states them."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
import pyopencl as cl

from iprt.commands.views import choose_view
from iprt.device.compute import ComputeDevice
from iprt.device.program import Program
from iprt.film import footage_of
from iprt.memory import RenderPlan
from iprt.settings.model import Settings
from tests.gpu import Need, allocated, budgets
from tests.on_device.frames import first_frame, opened, scenes

VERBOSE = "-cl-nv-verbose"
THREADS = 8
DEMO = "lounge"
Row = dict[str, object]


def test_programs(device: ComputeDevice, tell: Callable[..., None]) -> None:
    """Build the demo's programs one by one and in threads, then all others; check budgets."""
    demo, beyond = planned(device, DEMO), []
    programs = {
        name: of for scene in (DEMO, *scenes()) for name, of in planned(device, scene).items()
    }
    for number, (name, of) in enumerate(programs.items(), start=1):
        start = time.perf_counter()
        rows = built(device, of)
        tell(program=name, build_ms=1e3 * (time.perf_counter() - start), kernels=rows)
        beyond += [row for row in rows if row.get("within", True) is False]
        if number == len(demo):
            start = time.perf_counter()
            with ThreadPoolExecutor(THREADS) as pool:
                list(pool.map(lambda of: built(device, of), demo.values()))
            tell(program=f"{number} in threads", build_ms=1e3 * (time.perf_counter() - start))
    assert not beyond


def planned(device: ComputeDevice, name: str) -> dict[str, Program]:
    """Return the programs that the views of a scene build by default, by name."""
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
    """Build a program anew; return a row for each of its kernels."""
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
        own = {"kernel": name, "private bytes": private, "lanes": lanes}
        need, granted = needs.get(name), _budgets().get(name, _budgets()["others"])
        if need is not None:
            own |= {**vars(need), "budget": vars(granted)}
        within = limit >= largest and (need is None or need.most(granted) == granted)
        rows.append({**own, "within": within})
    return rows


@cache
def _budgets() -> dict[str, Need]:
    return budgets()["nvidia"]
