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
#include "maths/listed_items.h"
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


def test_headers_are_included_once_unless_they_ask_for_more(tmp_path: Path) -> None:
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib/once.h").write_text('#pragma once\n#include "each.h"\nint once;\n')
    (tmp_path / "lib/each.h").write_text("int each; // comment\n")
    source = '#include "once.h"\n#include "once.h"\n#include "each.h"\nint own;\n'
    text = kernel_source.resolved(source, "run.cl", {}, tmp_path)
    assert [text.count(word) for word in ("once;", "each;", "own;", "comment")] == [1, 2, 1, 0]


def test_the_folder_of_the_checkout_does_not_matter(tmp_path: Path) -> None:
    files = [path.relative_to(CL) for path in sorted(CL.rglob("*.cl"))]
    here = {file: Program.of(str(file)).text for file in files}
    for path in CL.rglob("*.*"):
        copy = tmp_path / path.relative_to(CL)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    for file in files:
        text = (tmp_path / file).read_text()
        assert kernel_source.resolved(text, str(file), {}, tmp_path) == here[file]
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
