"""Every kernel compiled for GPUs, without one: `python -m tests.gpu [--brief | --write]`.

clang with libclc links each variant that `tests.films` build for NVIDIA and AMD, and ptxas
allocates NVIDIA's registers. Exits with 1 if a kernel does not link, computes in double precision,
or needs more registers, stack or spilled bytes than `gpu_budgets.toml` beside this file grants it
(registers: and `SLACK`); `--write` grants each what it needs now.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from iprt.device.program import Program
from tests.films import planned_kernels

BUDGETS = Path(__file__).with_name("gpu_budgets.toml")
CLANG = "clang-19"
LIBCLC = Path("/usr/lib/clc")
PTXAS = Path(sysconfig.get_path("purelib"), "nvidia/cuda_nvcc/bin/ptxas")
MISSING = (
    f"kernels are not compiled for GPUs: that takes {CLANG} and libclc-19 (apt-get install {CLANG} "
    "libclc-19) and ptxas (pip install nvidia-cuda-nvcc-cu12)"
)
NVIDIA, AMD = ("sm_75", "sm_90"), ("gfx1030", "gfx1100")
SLACK = 4
"""Registers by which allocation varies with the order of unrelated instructions."""
ALL, BRIEF = (NVIDIA, AMD), (NVIDIA[:1], AMD[:1])

ALLOCATED = re.compile(
    r"(\d+) bytes stack.*?(\d+) bytes spill stores, (\d+) bytes spill loads.*?Used (\d+) registers",
    re.DOTALL,
)
"""What ptxas says of a kernel."""


@dataclass(frozen=True)
class Need:
    """Registers and memory that a kernel needs, or may need at most.

    Attributes
    ----------
    registers : int
        32-bit registers of a work item.
    stack, spilled : int
        Bytes of a work item in memory, and those of it that are spilled registers.
    """

    registers: int
    stack: int = 0
    spilled: int = 0

    def most(self, other: Need) -> Need:
        return Need(*map(max, zip(astuple(self), astuple(other), strict=True)))


class CompileError(Exception):
    """A variant does not compile or link, or has what no kernel may have."""


def installed() -> bool:
    """Return whether the compilers are installed."""
    return bool(shutil.which(CLANG)) and LIBCLC.is_dir() and _ptxas() is not None


def programs() -> list[Program]:
    """Return all that the films build, each once."""
    return list(dict.fromkeys(Program.of(one.file, one.defines) for one in planned_kernels()))


def compiled(
    program: Program, folder: Path, gpus: tuple[tuple[str, ...], tuple[str, ...]] = ALL
) -> dict[tuple[str, str], Need]:
    """Return the needs of a program's kernels, by vendor and kernel, on the most demanding GPU.

    Raises
    ------
    CompileError
    """
    needs: dict[tuple[str, str], Need] = {}
    of_nvidia, of_amd = nvidia(program, folder, gpus[0]), _amd(program, folder, gpus[1])
    for vendor, found in (("nvidia", of_nvidia), ("amd", of_amd)):
        for _, name, need in found:
            needs[vendor, name] = need.most(needs.get((vendor, name), need))
    return needs


def nvidia(
    program: Program, folder: Path, gpus: tuple[str, ...] = NVIDIA
) -> Iterator[tuple[str, str, Need]]:
    """Return the needs of a program's kernels: GPU, kernel and need.

    Raises
    ------
    CompileError
    """
    bitcode, assembly = folder / "program.bc", folder / "program.ptx"
    target = ["-target", "nvptx64-unknown-nvidiacl"]
    _run(
        *_clang(program, "nvptx64--nvidiacl", folder),
        *target,
        "-O2",
        "-emit-llvm",
        "-c",
        "-o",
        bitcode,
    )
    for gpu in gpus:
        cpu = ["-Xclang", "-target-cpu", "-Xclang", gpu]
        _run(CLANG, *target, *cpu, "-O3", "-S", "-x", "ir", bitcode, "-o", assembly)
        _require_single(assembly.read_text(), r"\.f64\b")
        # ptxas links: what is declared and not defined fails here.
        told = _run(_ptxas(), "-v", "-arch", gpu, assembly, "-o", os.devnull)
        for name, need in allocated(told).items():
            yield gpu, name, need


def allocated(told: str) -> dict[str, Need]:
    """Return the needs of kernels, by name, that ptxas or NVIDIA's driver reports."""
    kernels = re.split(r"Compiling entry function '(\w+)'", told)
    needs = {}
    for name, report in zip(kernels[1::2], kernels[2::2], strict=True):
        found = ALLOCATED.search(report)
        assert found is not None, report
        stack, stores, loads, registers = map(int, found.groups())
        needs[name] = Need(registers, stack, stores + loads)
    return needs


def _amd(program: Program, folder: Path, gpus: tuple[str, ...]) -> Iterator[tuple[str, str, Need]]:
    assembly = folder / "program.s"
    for gpu in gpus:
        target = ["-target", "amdgcn-mesa-mesa3d", f"-mcpu={gpu}", "-nogpulib"]
        _run(
            *_clang(program, f"{gpu}-amdgcn-mesa-mesa3d", folder),
            *target,
            "-O3",
            "-S",
            "-o",
            assembly,
        )
        text = assembly.read_text()
        _require_single(text, r"\bv_\w+_f64\b")
        missing = sorted(set(re.findall(r"(\w+)@gotpcrel32", text)))
        if missing:
            raise CompileError(f"unresolved for {gpu}: {', '.join(missing)}")
        kernels = re.split(r"\n(\w+):\s+; @\w+", text)
        for name, body in zip(kernels[1::2], kernels[2::2], strict=True):
            registers, stack = (
                re.search(rf"; {key}:\s*(\d+)", body) for key in ("NumVgprs", "ScratchSize")
            )
            if registers and stack:  # not so of functions that are called
                # Spilled registers are part of the stack.
                yield gpu, name, Need(int(registers[1]), int(stack[1]))


def _clang(program: Program, library: str, folder: Path) -> list[str | Path]:
    """Return the command that compiles a program, whose text goes to `folder`."""
    text = folder / "program.cl"
    text.write_text(program.text)
    builtins = ["-Xclang", "-mlink-builtin-bitcode", "-Xclang", LIBCLC / f"{library}.bc"]
    language = ["-x", "cl", "-Xclang", "-finclude-default-header"]
    options = [option for option in program.options if option != "-cl-kernel-arg-info"]
    return [CLANG, *language, *options, *builtins, text]


def _run(*command: str | Path) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    told = done.stdout + done.stderr
    if done.returncode:
        raise CompileError(told.strip()[:800])
    return told


def _require_single(assembly: str, double: str) -> None:
    if found := re.search(rf".*{double}.*", assembly):
        raise CompileError(f"double precision: {found[0].strip()}")


def _ptxas() -> Path | None:
    found = PTXAS if PTXAS.is_file() else shutil.which("ptxas")
    return None if found is None else Path(found)


def _defines(program: Program) -> int:
    return len(program.options)


def budgets() -> dict[str, dict[str, Need]]:
    """By vendor, that of each kernel, and of "others"."""
    read = tomllib.loads(BUDGETS.read_text())
    return {
        vendor: {kernel: Need(*need) for kernel, need in kernels.items()}
        for vendor, kernels in read.items()
    }


def exceeded(needs: dict[tuple[str, str], Need]) -> list[str]:
    """Return a line for each kernel that needs more than it is granted, and `SLACK` registers."""
    granted = budgets()
    lines = []
    for (vendor, kernel), need in sorted(needs.items()):
        budget = granted[vendor].get(kernel, granted[vendor]["others"])
        most = replace(budget, registers=budget.registers + SLACK)
        if need.most(most) != most:
            lines.append(f"{kernel} on {vendor}: needs {need}, may need {budget}")
    return lines


def write(needs: dict[tuple[str, str], Need]) -> None:
    """Grant each kernel what it needs, if that is more than all others may."""
    others = {vendor: kernels["others"] for vendor, kernels in budgets().items()}
    text = BUDGETS.read_text().partition("\n[")[0]
    for vendor, least in others.items():
        text += f"\n[{vendor}]\nothers = {list(astuple(least))}\n"
        for (of_vendor, kernel), need in sorted(needs.items()):
            if of_vendor == vendor and need.most(least) != least:
                text += f"{kernel} = {list(astuple(need))}\n"
    BUDGETS.write_text(text)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--write", action="store_true", help="grant what is needed now")
    parser.add_argument(
        "--brief",
        action="store_true",
        help="of each file only the variant with the most defines, for one GPU of each vendor",
    )
    asked = parser.parse_args()
    gpus = BRIEF if asked.brief else ALL
    if not installed():
        print(MISSING)
        return
    needs: dict[tuple[str, str], Need] = {}
    failures = []
    with TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count()) as workers:

        def work(numbered: tuple[int, Program]) -> dict[tuple[str, str], Need]:
            number, program = numbered
            own = Path(folder, str(number))
            own.mkdir()
            try:
                return compiled(program, own, gpus)
            except CompileError as error:
                failures.append(f"{program.name}: {error}")
                return {}

        chosen = programs()
        if asked.brief:
            chosen = list({one.file: one for one in sorted(chosen, key=_defines)}.values())
        for found in workers.map(work, enumerate(chosen)):
            for key, need in found.items():
                needs[key] = need.most(needs.get(key, need))
    if asked.write and not failures:
        write(needs)
    failures += exceeded(needs)
    for line in failures:
        print(line)
    print(f"{len(chosen)} variants for {', '.join(sum(gpus, ()))}: {len(failures)} failures")
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
