"""Model of frame times on GPUs: `python -m docs.gpu` fills the tables of `gpu.md`.

It takes Oclgrind, clang-19 with libclc-19, ptxas (see `tests.oclgrind` and `tests.gpu`), and some
five minutes. Columns of measured times come from `gpu_measured.json`, if there is one, which
`tests.on_device` writes.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from os import cpu_count
from pathlib import Path
from tempfile import TemporaryDirectory

from docs.gpu_counts import FRAME, FULL, SMALL, VIDEO, Count, Counts, Key, play
from docs.gpu_instructions import program_named, simulated
from iprt.device.choose import choose_device
from iprt.device.compute import ComputeDevice
from tests import gpu as compilers

PAGE = Path(__file__).with_name("gpu.md")
MEASURED = Path(__file__).with_name("gpu_measured.json")
HEADINGS = {FRAME: "### A frame of a head that turns", VIDEO: "### A new frame of the video"}
START, END = "<!-- measured -->", "<!-- end -->"

LAUNCH_S = 2e-6
"""Time between the end of a kernel and the start of the next one that needs its results."""
IN_FLIGHT = 16
"""Bytes that a thread of a streaming kernel waits for at a time: four loads of a float."""
RAY_BYTES, PIXEL_BYTES = 256, 64
"""Bytes from and to memory: of a ray, eight sectors of 32 bytes, as the finest cells, the surface
and the light at its end are in no cache; and of the pixel that sends it."""
LANES = 0.5
"""Share of the lanes of a warp that march while the longest of its rays is under way."""
OPTIMISED = 0.65
"""Share of the instructions counted by Oclgrind that ptxas leaves in kernels without loops."""
WINDOWS = {
    "resample_panorama": 4,
    "resample_glossy": 4,
    "resample_color": 16,
    "resample_highlight": 16,
    # Windows of 4x4 texels, whose colors are loaded again for each of eight sums.
    "sharpen_edges": 16,
    "sharpen_glossy": 16,
    "accumulate": 2.5,  # four taps of the history, one of all else
    "choose_level": 9,
    "filter_real": 9,
    "filter_reflected": 9,
    "smooth_real": 9,
    "smooth_reflected": 9,
    "fit_planes": 25,
    "build_surface": 5,
    "filter_highlight": 25,
}
"""How often a kernel asks for each value that it loads, as windows of neighbouring pixels overlap:
caches have it after the first time."""
REGISTERS, WARP = 65536, 32
"""Registers of a multiprocessor, and threads of a warp."""
PREPARING = frozenset(("picture", "surfaces", "pyramid", "background"))
"""Passes that prepare a frame of a video for rays, whatever the scene's materials are."""


@dataclass(frozen=True)
class Gpu:
    """Published figures of a GPU, and latencies and bandwidths of caches as microbenchmarks have
    found them on its generation.

    Attributes
    ----------
    flops, issued : float
        Operations in single precision a second, two for each multiplication with addition; and
        instructions of threads.
    memory, l2, l1 : float
        Bytes a second, of all multiprocessors together.
    threads : int
        That a multiprocessor holds at most.
    memory_s, l2_s : float
        From asking to having.
    goal_ms, video_goal_ms : float
        For a frame, and for preparing a frame of a video.
    """

    name: str
    target: str
    multiprocessors: int
    threads: int
    flops: float
    issued: float
    memory: float
    l2: float
    l1: float
    memory_s: float
    l2_s: float
    goal_ms: float
    video_goal_ms: float = 2.0

    def resident(self, registers: int) -> int:
        """Threads of a multiprocessor at a time."""
        warps = REGISTERS // (WARP * max(-(-registers // 8), 1) * 8)
        return min(self.threads, WARP * warps)


GPUS = (
    Gpu("RTX 2080", "sm_75", 46, 1024, 10e12, 10e12, 448e9, 1.8e12, 5.0e12, 600e-9, 115e-9, 3.0),
    Gpu("H100", "sm_90", 132, 2048, 60e12, 30e12, 3.35e12, 5.5e12, 29e12, 650e-9, 150e-9, 0.8),
)

Registers = dict[tuple[str, str, str], int]
"""Registers by GPU, program and kernel."""


@dataclass(frozen=True)
class Measured:
    """Times of a device in milliseconds, by the kind of frame, `FRAME` or `VIDEO`.

    Attributes
    ----------
    name : str
    kernels : dict of str to dict
        Times by the device's clock, by pass and kernel.
    wall : dict of str to float
        Time of all kernels, by the host's clock.
    """

    name: str
    kernels: dict[str, dict[Key, float]]
    wall: dict[str, float]


@dataclass(frozen=True)
class Estimate:
    """The time of a kernel in a pass, in seconds.

    Attributes
    ----------
    limits : dict of str to float
        Time by limiting resource; the largest counts.
    launches : float
        Time between kernels.
    """

    limits: dict[str, float]
    launches: float

    @property
    def limit(self) -> str:
        return max(self.limits, key=self.limits.__getitem__)

    @property
    def ms(self) -> float:
        return 1e3 * (self.limits[self.limit] + self.launches)


def estimate(gpu: Gpu, kernel: str, count: Count, registers: Registers) -> Estimate:
    """Estimate the least time of the launches of a kernel."""
    resident = gpu.resident(registers.get((gpu.target, count.program, kernel), 0))
    waiting = resident * gpu.multiprocessors * IN_FLIGHT
    memory = min(gpu.memory, waiting / gpu.memory_s)
    marches = count.steps > 0
    limits = {
        "memory": moved(count, kernel) / memory,
        "cache": count.requested / (gpu.l2 if marches else gpu.l1),
        "flops": count.flops / gpu.flops,
        "issue": count.instructions * OPTIMISED / gpu.issued / (LANES if marches else 1.0),
    }
    if marches:
        rays = min(resident * gpu.multiprocessors, count.items) * LANES
        limits["latency"] = count.steps * gpu.l2_s / rays
    return Estimate(limits, count.launches * LAUNCH_S)


def moved(count: Count, kernel: str) -> float:
    """Return the bytes from and to memory, if caches keep everything that is needed again."""
    window = WINDOWS.get(kernel, 1)
    if "-DTAPS=5" in count.program:
        window = 25
    most = min(count.bound, count.stored + count.loaded / window)
    if count.steps:
        most = min(most, count.rays * RAY_BYTES + count.active * PIXEL_BYTES)
    return most


# The table ----------------------------------------------------------------------------------


def table(
    counts: Counts, registers: Registers, measured: Mapping[str, Mapping[Key, float]]
) -> list[str]:
    """Build a row per kernel of a pass, and their sum; `measured` times by device and kernel."""
    head = ["pass", "kernel", "launches", "items", "rays", "steps/ray", "MB", "MB asked for"]
    head += ["MFLOP", "M instr.", *(f"regs {gpu.target}" for gpu in GPUS)]
    for gpu in GPUS:
        head += [f"{gpu.name} ms", "limit"]
    head += [f"{name}, measured ms" for name in measured]
    marks = ["---", "---", *["---:"] * 10, *["---:", "---"] * len(GPUS), *["---:"] * len(measured)]
    lines = [_line(head), _line(marks)]
    for (part, kernel), count in counts.items():
        found = [registers.get((gpu.target, count.program, kernel), "") for gpu in GPUS]
        cells = [
            part,
            f"`{kernel}`",
            str(count.launches),
            _thousands(count.items) if count.items else "",
            _thousands(count.rays) if count.rays else "",
            f"{count.steps / count.rays:.1f}" if count.rays else "",
            f"{moved(count, kernel) / 1e6:.1f}",
            f"{count.requested / 1e6:.1f}",
            f"{count.flops / 1e6:.0f}",
            f"{count.instructions / 1e6:.0f}",
            *map(str, found),
        ]
        for gpu in GPUS:
            times = estimate(gpu, kernel, count, registers)
            cells += [f"{times.ms:.3f}", times.limit]
        for found_ms in measured.values():
            cells.append(f"{found_ms[part, kernel]:.3f}" if (part, kernel) in found_ms else "")
        lines.append(_line(cells))
    sums = ["all", "", str(sum(count.launches for count in counts.values())), *[""] * 9]
    for gpu in GPUS:
        sums += [f"**{total(gpu, counts, registers):.2f}**", ""]
    sums += [f"**{sum(found_ms.values()):.2f}**" for found_ms in measured.values()]
    return [*lines, _line(sums)]


def total(gpu: Gpu, counts: Counts, registers: Registers) -> float:
    """Return the milliseconds of all kernels."""
    return sum(estimate(gpu, kernel, count, registers).ms for (_, kernel), count in counts.items())


def verdict(what: str, counts: Counts, registers: Registers, goals: Iterable[float]) -> list[str]:
    """Describe for each GPU the distance to the goal, and the slowest kernels."""
    lines = []
    for gpu, goal in zip(GPUS, goals, strict=True):
        times = {key: estimate(gpu, key[1], count, registers).ms for key, count in counts.items()}
        most: list[Key] = sorted(times, key=times.__getitem__, reverse=True)[:3]
        named = ", ".join(
            f"`{kernel}` of {part} {times[part, kernel]:.2f}" for part, kernel in most
        )
        lines.append(
            f"- {what} on {gpu.name}: {sum(times.values()):.2f} ms, goal {goal:g} ms; most: {named}"
        )
    return lines


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _thousands(number: int) -> str:
    return f"{number / 1e3:.0f}k" if number >= 10_000 else str(number)


def page_part(
    video: Counts, frame: Counts, registers: Registers, measured: Sequence[Measured] = ()
) -> str:
    """Build the text between `START` and `END`."""
    scene = {key: count for key, count in video.items() if key[0] in PREPARING}
    goals, video_goals = ([getattr(g, n) for g in GPUS] for n in ("goal_ms", "video_goal_ms"))
    lines = [
        *verdict("A frame", frame, registers, goals),
        *verdict("Preparing a video frame", scene, registers, video_goals),
    ]
    lines += [
        f"- Measured on {one.name}, by the host's clock: {one.wall[FRAME]:.2f} ms for a frame, "
        f"{one.wall[VIDEO]:.2f} ms for a new frame of the video"
        for one in measured
    ]
    for what, counts in ((FRAME, frame), (VIDEO, video)):
        times = {one.name: one.kernels[what] for one in measured}
        lines += [f"\n{HEADINGS[what]}\n", *table(counts, registers, times)]
    return "\n".join(lines)


def modelled(page: str, what: str) -> dict[Key, dict[str, float]]:
    """Read the model's times of a kind of frame from the page: pass and kernel -> GPU -> ms."""
    _, _, text = page.partition(f"{HEADINGS[what]}\n")
    rows = [line.split("|")[1:-1] for line in text.split("\n#")[0].splitlines() if "|" in line]
    lines = [[cell.strip() for cell in row] for row in rows]
    found = {}
    for line in lines[2:]:
        cells = dict(zip(lines[0], line, strict=True))
        key = cells["pass"], cells["kernel"].strip("`")
        found[key] = {f"{g.name} ms": float(cells[f"{g.name} ms"].strip("*")) for g in GPUS}
    return found


# Measured times -----------------------------------------------------------------------------


def read_measured(path: Path = MEASURED) -> list[Measured]:
    """Read the output of `tests.on_device` for frames of the model's size; none without a file."""
    if not path.exists():
        return []
    devices = json.loads(path.read_text(encoding="utf-8"))["devices"]
    return [
        Measured(
            one["device"],
            {w: {(part, name): ms for part, name, ms in one[w]["kernels"]} for w in HEADINGS},
            {what: one[what]["wall_ms"] for what in HEADINGS},
        )
        for one in devices
        if (one["view"], one["rows"]) == (FULL.view, FULL.rows)
    ]


# Measuring ----------------------------------------------------------------------------------


def registers_of(programs: Iterable[str]) -> Registers:
    """Compile programs as `tests.gpu` does; return the registers of all kernels."""

    def compiled(program: str) -> Registers:
        with TemporaryDirectory() as folder:
            needs = compilers.nvidia(program_named(program), Path(folder))
            return {(target, program, kernel): need.registers for target, kernel, need in needs}

    with ThreadPoolExecutor(cpu_count()) as workers:
        found: Registers = {}
        for registers in workers.map(compiled, sorted(set(programs))):
            found |= registers
    return found


def main() -> None:
    """Fill the page."""
    if not compilers.installed():
        sys.exit(compilers.MISSING)
    small = simulated(SMALL)
    full = play(ComputeDevice(choose_device(None)), FULL)
    counts = {
        what: {key: count.scaled(small[what][key]) for key, count in full[what].items()}
        for what in (VIDEO, FRAME)
    }
    registers = registers_of(c.program for of in counts.values() for c in of.values() if c.program)
    part = page_part(counts[VIDEO], counts[FRAME], registers, read_measured())
    page = PAGE.read_text(encoding="utf-8")
    pattern = f"{re.escape(START)}.*?{re.escape(END)}"
    filled = re.sub(pattern, lambda _: f"{START}\n\n{part}\n\n{END}", page, flags=re.DOTALL)
    PAGE.write_text(filled, encoding="utf-8")


if __name__ == "__main__":
    main()
