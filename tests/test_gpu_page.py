"""`docs/gpu.py`: the model's times from counts, and the kernels on its page."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from docs import gpu
from docs.gpu import GPUS, Gpu, estimate, moved, page_part
from docs.gpu_counts import FILL, FRAME, GBUFFER, VIDEO, Count, Size, play
from docs.gpu_instructions import add, widths
from iprt.device.compute import ComputeDevice
from tests import gpu as compilers
from tests.films import entry_points

PLAIN = Gpu("plain", "sm_00", 10, 1000, 1e12, 1e12, 1e9, 4e9, 8e9, 1e-6, 1e-7, 1.0)
HISTOGRAM = """
Instructions executed for kernel 'planted':
           70 - load private (280 bytes)
           30 - load global (480 bytes)
           10 - store global (40 bytes)
           10 - fadd
            5 - call llvm.fmuladd.v3f32()
            6 - call _Z10vload_halfmPU3AS1KDh()
            3 - call _Z11vstore_halffmPU3AS1Dh()
            2 - call _Z6vload4mPU3AS1Ki()
            8 - call _Z6vload3mPU3AS1Kf()
            9 - call _Z7vstore3Dv3_fmPU3AS1f()
            7 - call _Z6vload2mPU3AS0Ki()
            4 - call own_function()
"""


@pytest.mark.skipif(not compilers.installed(), reason=compilers.MISSING)
def test_a_histogram_is_added_up(tmp_path: Path) -> None:
    file = tmp_path / "planted.cl"
    file.write_text(
        "__kernel void planted(__global float4 *a, __global float *b)"
        "{ const int i = get_global_id(0); a[i] = a[i] + a[i + 1]; b[i] = b[i] * b[i + 1]; }"
    )
    assert widths(str(file)) == {"fadd": 4.0, "fmul": 1.0}
    count = Count(str(file))
    add(count, HISTOGRAM)
    add(count, HISTOGRAM)
    assert (count.loaded, count.stored) == (
        2 * (480 + 6 * 2 + 8 * 12),
        2 * (40 + 3 * 2 + 9 * 12),
    )
    assert count.flops == 2 * (10 * 4 + 5 * 6)
    assert count.instructions == 2 * (30 * 2 + 10 * 2 + 10 * 4 + 5 * 3 + 35 * 2)


def test_the_slowest_limit_counts() -> None:
    registers = {("sm_00", "p", "k"): 64}  # 1024 threads of 65536 registers, of which 1000 run
    # 10 * 1000 threads wait for 16 bytes each: 160 GB/s would be possible, so memory is the limit.
    streams = Count("p", 3, 1000, bound=2_000_000, loaded=8_000_000, stored=0)
    times = estimate(PLAIN, "k", streams, registers)
    assert times.limits["memory"] == pytest.approx(2e-3)
    assert times.limits["cache"] == pytest.approx(1e-3)
    assert times.limit == "memory"
    assert times.ms == pytest.approx(2.0 + 3 * 2e-3)

    wide = replace(streams, bound=10**9, loaded=10**9)
    assert estimate(PLAIN, "k", wide, registers).limits["memory"] == pytest.approx(1.0)
    window = estimate(PLAIN, "smooth_real", replace(wide, loaded=9 * 10**8), registers)
    assert window.limits["memory"] == pytest.approx(0.1)
    few = Gpu(**{**vars(PLAIN), "memory": 160e9, "threads": 500})
    assert estimate(few, "k", wide, registers).limits["memory"] == pytest.approx(1e9 / 80e9)

    traced = Count("p", 1, 5000, 10**9, 10, 100, steps=4000, loaded=4_000_000, instructions=10**9)
    assert moved(traced, "k") == 100 * 256 + 10 * 64
    times = estimate(PLAIN, "k", traced, registers)
    assert times.limits["cache"] == pytest.approx(1e-3)
    assert times.limits["issue"] == pytest.approx(0.65e-3 / 0.5)
    assert times.limits["latency"] == pytest.approx(4000 * 1e-7 / 2500)
    assert times.limit == "issue"


def test_small_runs_are_scaled_by_steps_or_items() -> None:
    small = Count("p", 1, 10, steps=20, loaded=40, stored=8, flops=100.0, instructions=300.0)
    full = Count("p", 2, 1000, steps=60).scaled(small)
    assert (full.loaded, full.stored, full.flops, full.instructions) == (120, 24, 300.0, 900.0)
    plain = Count("p", 2, 1000).scaled(replace(small, steps=0))
    assert (plain.loaded, plain.flops) == (4000, 10_000.0)
    fill = Count("", 1, bound=5, stored=5)
    assert fill.scaled(fill) == fill


@pytest.mark.thorough
def test_a_frame_is_counted(device: ComputeDevice) -> None:
    size = Size(16, 16, 1, {**GBUFFER, "method": "ibl"})
    marked: list[tuple[str, ...]] = []
    counts = play(device, size, marked.append)
    assert set(counts) == {VIDEO, FRAME}
    composite = counts[FRAME]["composite", "composite"]
    assert (composite.launches, composite.items) == (1, 16 * 16)
    see = counts[FRAME]["draw objects", "see_objects"]
    assert see.rays == see.active == see.items > 0
    assert see.steps >= see.rays
    assert "COUNT_WORK" not in see.program
    launches = sum(c.launches for of in counts.values() for (_, k), c in of.items() if k != FILL)
    assert launches == sum(bool(names) for names in marked)
    assert marked[-1] == ()


def test_the_page_names_what_misses_the_goal_and_kernels_that_there_are() -> None:
    count = Count("p", 1, 10, bound=10**10, loaded=10**10)
    registers = {(gpu.target, "p", "composite"): 32 for gpu in GPUS}
    part = page_part({}, {("composite", "composite"): count}, registers)
    assert "A frame on RTX 2080: 22.32 ms, goal 3 ms; most: `composite` of composite 22.32" in part
    text = gpu.PAGE.read_text(encoding="utf-8")
    table = text.partition(gpu.START)[2].partition(gpu.END)[0]
    named = set(re.findall(r"^\| [\w ]+ \| `(\w+)`", table, re.MULTILINE))
    assert named - {FILL} <= entry_points()
    assert {"trace_delta", "trace_virtual", "filter_real", "composite", "remember"} <= named
