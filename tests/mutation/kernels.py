"""Defects planted by hand in the kernels: signs, bounds, seams, poles, densities, weights, axes.

They are listed in kernels.txt. A line `FILE: TESTS` opens the defects of a file that those tests
guard ("Changing a kernel" in docs/testing.md). Each defect is a line `- text`, a piece that occurs
once in the file, and a line `+ text`, its replacement. A line `= reason` below explains why no test
can see it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tests.mutation.mutant import Mutant

LIST = Path(__file__).with_name("kernels.txt")


def planted() -> list[Mutant]:
    """The defects of kernels.txt."""
    mutants: list[Mutant] = []
    file, tests, old = "", "", ""
    for line in LIST.read_text(encoding="utf-8").splitlines():
        mark, text = line[:2], line[2:]
        if mark == "- ":
            old = text
        elif mark.rstrip() == "+":
            mutants.append(Mutant(file, old, text, tuple(tests.split())))
        elif mark == "= ":
            mutants[-1] = replace(mutants[-1], equivalent=text)
        elif line:
            file, tests = line.split(": ")
    return mutants
