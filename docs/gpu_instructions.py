"""Costs of the instructions of kernels, as Oclgrind counts them: for `docs/gpu.py`."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from docs.gpu_counts import ROOT, Count, Counts, Size, play
from iprt.device.program import Program
from tests.gpu import CLANG
from tests.oclgrind import LIBRARY, MISSING, SimulatedDevice, oclgrind_environment

MARK = "LAUNCH "
COUNTED = re.compile(r"^ +(\d+) - ([^\n]+?)(?: \((\d+) bytes\))?$", re.MULTILINE)
"""A line of a histogram: how often, which instruction, and bytes that it moved."""
MOVE = re.compile(
    r"call _Z\d+v(?P<way>load|store)(?P<half>_half)?(?P<components>\d*)\D.*"
    r"(?:AS1|CLglobal)K?(?:Dh|f)\("
)
"""Functions that move floats, whole or in half precision, to and from global memory: Oclgrind does
not tell their bytes. Functions for vectors of int read values that all items of a row share."""

FLOATS = frozenset(("fadd", "fsub", "fmul", "fdiv", "fneg", "fcmp"))
MERGED = re.compile(
    r"alloca|getelementptr|load|store|phi|ret|bitcast|sext|zext|trunc|fneg|extractelement"
    r"|insertelement|shufflevector|addrspacecast"
)
"""Instructions that an optimiser removes, or merges into their neighbours."""

DIVISION, FUNCTION = 8, 20
"""Instructions of a division or square root, and of a sine or the like: their unit is four times as
slow, and others correct its result."""
LONG_FUNCTION = re.compile(r"sin|cos|tan|exp|log|pow")
COSTS = {
    # (floating point operations, instructions) for each component
    "fmuladd": (2, 1),
    "fma": (2, 1),
    "mad": (2, 1),
    "mix": (3, 2),
    "clamp": (2, 2),
    "sqrt": (1, DIVISION),
    "rsqrt": (1, DIVISION),
    "dot": (2, 1),
    "cross": (3, 2),
    "length": (2, 1 + DIVISION / 3),
    "distance": (3, 2 + DIVISION / 3),
    "normalize": (3, 2 + DIVISION / 3),
    "fabs": (1, 0),  # a modifier of the instruction that reads it
}


def simulated(size: Size) -> dict[str, Counts]:
    """Run `play` on Oclgrind and count instructions too.

    Raises
    ------
    SystemExit
        Oclgrind is not installed.
    """
    if not LIBRARY.exists():
        sys.exit(MISSING)
    with TemporaryDirectory() as name:
        file = Path(name) / "counts.json"
        program = (
            f"from docs.gpu_instructions import simulate; simulate({str(file)!r}, {asdict(size)!r})"
        )
        told = subprocess.run(
            [sys.executable, "-c", program],
            cwd=ROOT,
            env=oclgrind_environment(Path(name), OCLGRIND_INST_COUNTS="1"),
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        ).stdout
        played = json.loads(file.read_text())
    found: dict[str, Counts] = {
        what: {(part, kernel): Count(**count) for part, kernel, count in counts}
        for what, counts in played.items()
    }
    _, *blocks = re.split(rf"^{MARK}(.*)$", told, flags=re.MULTILINE)
    for names, histogram in zip(blocks[::2], blocks[1::2], strict=True):
        if names:
            what, part, kernel = names.split("|")
            add(found[what][part, kernel], histogram)
    return found


def simulate(file: str, size: dict[str, Any]) -> None:
    """Play on Oclgrind, in a process that `simulated` has started."""
    device = SimulatedDevice()
    found = play(device, Size(**size), lambda names: print(MARK + "|".join(names), flush=True))
    plain = {
        what: [(*key, asdict(count)) for key, count in counts.items()]
        for what, counts in found.items()
    }
    Path(file).write_text(json.dumps(plain))


def add(count: Count, histogram: str) -> None:
    """Add what Oclgrind prints of a launch."""
    width = widths(count.program)
    for times, instruction, size in COUNTED.findall(histogram):
        flops, issued = cost(instruction, width)
        count.flops += int(times) * flops
        count.instructions += int(times) * issued
        if instruction == "load global":
            count.loaded += int(size)
        elif instruction == "store global":
            count.stored += int(size)
        elif call := MOVE.match(instruction):
            moved = int(times) * (2 if call["half"] else 4) * int(call["components"] or 1)
            count.loaded += moved if call["way"] == "load" else 0
            count.stored += moved if call["way"] == "store" else 0


def cost(instruction: str, width: Mapping[str, float]) -> tuple[float, float]:
    """Return the floating point operations and the GPU instructions of one instruction.

    Parameters
    ----------
    instruction : str
        As Oclgrind names it.
    width : mapping of str to float
        Mean number of components of instructions whose names do not state it.
    """
    name, _, rest = instruction.partition(" ")
    if name == "call":
        return _call_cost(rest.removesuffix("()"))
    if name in ("load", "store") and rest in ("global", "constant", "local"):
        return 0.0, 2.0 if rest == "global" else 1.0  # its address takes another
    components = width.get(name, 1.0)
    if name in FLOATS:
        issued = {"fdiv": DIVISION, "fneg": 0}.get(name, 1)
        return components, components * issued
    if name in ("sdiv", "srem", "udiv", "urem"):
        return 0.0, float(FUNCTION)
    return 0.0, float(not MERGED.fullmatch(name))


def _call_cost(function: str) -> tuple[float, float]:
    """Return the cost of a function of OpenCL or LLVM; our own functions are counted by parts."""
    if match := re.fullmatch(r"llvm\.(\w+)\.(?:v(\d+))?f32", function):
        name, components = match[1], int(match[2] or 1)
    elif match := re.match(r"_Z\d+([a-z_]+)", function):
        name, vector = match[1], re.search(r"Dv(\d+)_", function)
        # The last letter of the name may be the first of its arguments' types.
        length = int(re.match(r"_Z(\d+)", function)[1])  # type: ignore[index]
        name, components = name[:length], int(vector[1]) if vector else 1
    else:
        return 0.0, 0.0
    if name.startswith("get_"):
        return 0.0, 1.0
    if name.startswith(("vload", "vstore", "atomic", "mem")):
        return 0.0, 2.0
    flops, issued = COSTS.get(name, (1, FUNCTION if LONG_FUNCTION.search(name) else 1))
    return float(flops * components), float(issued * components)


def program_named(name: str) -> Program:
    """Return the program that a profile calls `name`: a file and its defines."""
    file, *defines = name.split()
    return Program.of(file, dict(define.removeprefix("-D").split("=") for define in defines))


@cache
def widths(program: str) -> dict[str, float]:
    """Return the mean number of components of the program's floating point instructions."""
    source = program_named(f"{program} -DWITHOUT_INLINING=1")
    command = [CLANG, "-x", "cl", "-cl-std=CL1.2", "-Xclang", "-finclude-default-header"]
    target = ["-target", "spir64-unknown-unknown", "-O0", "-S", "-emit-llvm", "-o", "-"]
    defines = [option for option in source.options if option.startswith("-D")]
    text = subprocess.run(
        [*command, *target, *defines, "-"],
        input=source.text,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout
    number: Counter[str] = Counter()
    components: Counter[str] = Counter()
    for name, width in re.findall(r"= (f\w+) (?:[a-z]+ )*(?:<(\d+) x )?float", text):
        number[name] += 1
        components[name] += int(width or 1)
    return {name: components[name] / number[name] for name in number}
