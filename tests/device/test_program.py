"""Programs: one text for what compiles alike, wherever it lies, and errors at the right lines."""

from __future__ import annotations

from pathlib import Path

import pyopencl as cl
import pytest

from iprt.device import kernel_source
from iprt.device.compute import ComputeDevice
from iprt.device.program import Program, build
from iprt.errors import KernelError
from iprt.files.resources import CL

TEXT = """
/* a comment
   of two lines */
#include "maths/list.h"
#ifdef TWICE
#define FACTOR 2
#else
#define FACTOR 1
#endif
#if defined(__has_attribute)
#define KIND static
#endif
#ifndef KIND
#define KIND static inline
#endif
KIND int scaled(int value) { return FACTOR * value + OFFSET; }
__kernel void run(__global int *out)
{
    out[get_global_id(0)] = scaled(1);
    WRONG
}
"""


def program(**defines: int | bool) -> Program:
    return Program.of_text(TEXT, "run.cl", {"OFFSET": 3, "WRONG": False, **defines})


def test_defines_that_change_nothing_make_no_program_of_their_own() -> None:
    plain = program()
    assert program(UNKNOWN=1) == plain
    assert program(TWICE=False) == plain
    assert program(TWICE=True) != plain
    assert program(OFFSET=4) != plain
    assert program(UNKNOWN=1).key == plain.key
    assert program(OFFSET=4).key != plain.key
    assert [option for option in plain.options if option.startswith("-D")] == ["-DOFFSET=3"]


def test_the_compiler_decides_what_only_it_knows() -> None:
    assert "#if defined(__has_attribute)" in program().text
    assert "#ifndef KIND" in program().text
    assert "#define KIND static inline" in program().text
    assert "#ifdef TWICE" not in program().text


def test_the_folder_of_the_checkout_does_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = [path.relative_to(CL) for path in sorted(CL.rglob("*.cl"))]
    here = {file: Program.of(str(file)).text for file in files}
    for path in CL.rglob("*.*"):
        copy = tmp_path / path.relative_to(CL)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    monkeypatch.setattr("iprt.device.program.CL", tmp_path)
    kernel_source._text.cache_clear()
    for file in files:
        text = (tmp_path / file).read_text()
        assert Program.of_text(text, str(file)).text == here[file]
        assert str(CL) not in here[file]


def test_the_driver_is_given_no_folders(device: ComputeDevice) -> None:
    """Its cache knows programs by their options too, and environments lie in different folders."""
    correct = Program.of_text(TEXT, "run.cl", {"OFFSET": 3, "WRONG": ""})
    given = build(device.context, correct).get_build_info(
        device.device, cl.program_build_info.OPTIONS
    )
    assert given.split() == list(correct.options)


def test_errors_are_reported_at_their_line(device: ComputeDevice) -> None:
    wrong = TEXT.replace("WRONG", "int x = nowhere;")
    number = wrong.splitlines().index("    int x = nowhere;") + 1
    with pytest.raises(KernelError, match=rf"run\.cl:{number}:.*nowhere"):
        build(device.context, Program.of_text(wrong, "run.cl", {"OFFSET": 1}))


def test_programs_are_built_when_they_are_needed(device: ComputeDevice) -> None:
    own = ComputeDevice(device.device)
    one = own.kernel("world/real/pyramid.cl", "reduce_range")
    other = own.kernel("world/real/pyramid.cl", "reduce_range", {"UNKNOWN": True})
    assert len(own.built_programs) == 1
    assert one.make() is not None
    assert other.program == one.program
