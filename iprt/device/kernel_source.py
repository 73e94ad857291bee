"""Source of kernels with their included files and the structs of their blocks in place.

The text does not depend on the checkout's place, and comments change nothing: drivers cache
compiled kernels by their text.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path

from iprt.device.block import Block, flat_kernels, structs
from iprt.files.resources import CL

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_DEFINE = re.compile(r"^#define (\w+) ?(.*)$", re.MULTILINE)
_INCLUDE = re.compile(r'#include (?:"(.+)"|<(.+)>)')
_ONCE = "#pragma once"


def resolved(text: str, name: str, macros: Mapping[str, str], folder: Path = CL) -> str:
    """Return the source that compilers take; they report errors under the names of files.

    `#include "FILE"` stands for a file beside, or in `lib/`; `#include <MODULE>` for the structs of
    the blocks that a Python module declares. Conditions are left to the compiler, so an include
    must not depend on one.

    Parameters
    ----------
    text : str
        OpenCL C.
    name : str
        Its path below `cl/`.
    macros : mapping of str to str
        Macros that the compiler gets by `-D`.
    folder : Path, optional
        `cl/`.
    """
    blocks: dict[str, type[Block]] = {}
    included: set[str] = set()
    lines: list[str] = []

    def add(text: str, name: str) -> None:
        lines.append(f'#line 1 "{name}"')
        for part, number in _parts(text):
            if isinstance(part, str):
                lines.append(part)
                continue
            if part[2]:
                lines.extend(_structs(part[2], blocks))
            else:
                beside = os.path.normpath(os.path.join(os.path.dirname(name), part[1]))
                file = beside if os.path.isfile(os.path.join(folder, beside)) else f"lib/{part[1]}"
                text = (folder / file).read_text()
                if file not in included:
                    add(text, file)
                if _ONCE in text:
                    included.add(file)
            lines.append(f'#line {number + 1} "{name}"')

    add(text, name)
    whole = "\n".join(lines) + "\n"
    return flat_kernels(whole, blocks, dict(_DEFINE.findall(text)) | dict(macros))


def _structs(module: str, known: dict[str, type[Block]]) -> Iterator[str]:
    for block in vars(import_module(module)).values():
        if isinstance(block, type) and block.__module__ == module and issubclass(block, Block):
            yield from structs(block, known)


@cache
def _parts(text: str) -> list[tuple[str | re.Match[str], int]]:
    """Return the lines without comments, in runs that end at includes, and each one's number."""
    parts: list[tuple[str | re.Match[str], int]] = []
    run: list[str] = []
    for number, line in enumerate(_without_comments(text).splitlines(), 1):
        found = _INCLUDE.match(line) if line.startswith("#include") else None
        if found is None:
            run.append("" if line == _ONCE else line)
            continue
        if run:
            parts.append(("\n".join(run), number - 1))
        parts.append((found, number))
        run = []
    if run:
        parts.append(("\n".join(run), 0))
    return parts


@cache
def _without_comments(text: str) -> str:
    """Remove comments, without changing line numbers."""
    text = _COMMENT.sub(lambda comment: " " + "\n" * comment[0].count("\n"), text)
    return re.sub(r"[ \t]+(?=\n)", "", text)


def constant(file: str, name: str) -> int:
    """Return the integer that a file of `cl/` defines as `name`."""
    return int(_constants(file)[name])


def float_constant(file: str, name: str) -> float:
    """Return the single-precision constant, such as 0.1f, that a file of `cl/` defines."""
    return float(_constants(file)[name].removesuffix("f"))


@cache
def _constants(file: str) -> dict[str, str]:
    return dict(_DEFINE.findall(_without_comments((CL / file).read_text())))
