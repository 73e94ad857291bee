"""Blocks of kernel arguments: one declaration for the struct, the parameters and their binding.

A kernel takes a block like any struct, `const World world`. OpenCL allows no pointers in structs
that kernels take, so `flat_kernels` replaces it by a parameter per member, such as
`world_real_grid_width`, and begins the kernel's body with the struct made of them. A launch takes
an instance: `kernel(size, world=WorldArgs(...))`.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import pyopencl.array as cla

Int32 = Annotated[int, "const int"]
Float32 = Annotated[float, "const float"]
Int4 = Annotated[Any, "const int4"]
Float4 = Annotated[Any, "const float4"]
Floats = Annotated[cla.Array | None, "__global const float *restrict"]
Float2s = Annotated[cla.Array | None, "__global const float2 *restrict"]
Float4s = Annotated[cla.Array | None, "__global const float4 *restrict"]
Halves = Annotated[cla.Array | None, "__global const half *restrict"]
Ints = Annotated[cla.Array | None, "__global const int *restrict"]
Int4s = Annotated[cla.Array | None, "__global const int4 *restrict"]
Counters = Annotated[cla.Array | None, "__global uint *restrict"]
"""Types of members: numbers, vectors and buffers of these. None is a null pointer."""

_KERNEL = re.compile(r"\b(?:__kernel|TRACING_KERNEL)\s+void\s+\w+\s*\(([^{]*)\)\s*\{")
_TAKEN = re.compile(r"const (\w+) (\w+)\s*\Z")


def when(condition: str, *, outer: str = "") -> Any:
    """Declare a member that some programs lack.

    Parameters
    ----------
    condition : str
        Macros that the program must define, or with `!` must not, separated by spaces.
    outer : str
        Parameter of the kernel that the member is a copy of, instead of one of its own.
    """
    return dataclasses.field(default=None, metadata={"when": condition, "outer": outer})


class Member(NamedTuple):
    """A member of a block.

    Attributes
    ----------
    name : str
    kind : str or type
        Type of its parameter in C, or the class of a nested block.
    when, outer : str
        As in `when()`.
    """

    name: str
    kind: Any
    when: str
    outer: str


class Block:
    """Base class of blocks: dataclasses whose names end in `Args`, which the struct's lacks."""

    def arguments(self, name: str) -> dict[str, Any]:
        """Return the arguments of a kernel's parameter `name` by their flat names."""
        found: dict[str, Any] = {}
        for member in _members(type(self)):
            value = getattr(self, member.name)
            if isinstance(value, Block):
                found |= value.arguments(f"{name}_{member.name}")
            elif not (member.outer or isinstance(member.kind, type)):
                found[f"{name}_{member.name}"] = value
        return found


_MEMBERS: dict[type[Block], tuple[Member, ...]] = {}


def _members(block: type[Block]) -> tuple[Member, ...]:
    if block not in _MEMBERS:
        hints = get_type_hints(block, include_extras=True)
        _MEMBERS[block] = tuple(
            Member(one.name, _kind(hints[one.name]), **{"when": "", "outer": "", **one.metadata})
            for one in dataclasses.fields(block)  # type: ignore[arg-type]
        )
    return _MEMBERS[block]


def _kind(hint: Any) -> Any:
    if isinstance(hint, type) and issubclass(hint, Block):
        return hint
    nested = [one for one in get_args(hint) if isinstance(one, type) and issubclass(one, Block)]
    return nested[0] if nested else hint.__metadata__[0]


def _present(block: type[Block], defined: Collection[str]) -> Iterator[Member]:
    """Yield the members that a program with these macros has."""
    for member in _members(block):
        words = member.when.split()
        if all((word.lstrip("!") in defined) != word.startswith("!") for word in words):
            yield member


def struct_name(block: type[Block]) -> str:
    """Return the name of the block's struct."""
    return block.__name__.removesuffix("Args")


def structs(
    block: type[Block], defined: Collection[str], known: dict[str, type[Block]]
) -> Iterator[str]:
    """Yield the definitions of a block's struct and of nested ones, without the `known` ones.

    `known` gets their blocks by name. A struct without members is not defined.
    """
    if struct_name(block) in known:
        return
    lines = []
    for member in _present(block, defined):
        kind = member.kind
        if isinstance(kind, type):
            yield from structs(kind, defined, known)
            kind = struct_name(kind)
        kind = kind.removeprefix("const ").removesuffix("restrict")
        lines.append(f"    {kind} {member.name};")
    known[struct_name(block)] = block
    if lines:
        yield "\n".join(["typedef struct {", *lines, f"}} {struct_name(block)};"])


def _parameters(block: type[Block], name: str, defined: Collection[str]) -> Iterator[str]:
    for member in _present(block, defined):
        if isinstance(member.kind, type):
            yield from _parameters(member.kind, f"{name}_{member.name}", defined)
        elif not member.outer:
            yield f"{member.kind} {name}_{member.name}"


def _initialiser(block: type[Block], name: str, defined: Collection[str]) -> str:
    parts = []
    for member in _present(block, defined):
        value = member.outer or f"{name}_{member.name}"
        if isinstance(member.kind, type):
            value = _initialiser(member.kind, value, defined)
        parts.append(f".{member.name} = {value}")
    return f"{{{', '.join(parts)}}}"


def flat_kernels(text: str, blocks: Mapping[str, type[Block]], defined: Collection[str]) -> str:
    """Return OpenCL C whose kernels take the members of blocks instead of the blocks.

    Line numbers stay.
    """

    def flat(kernel: re.Match[str]) -> str:
        taken, structs_made = [], []
        for parameter in split_parameters(kernel[1]):
            found = _TAKEN.search(parameter)
            if found is None or found[1] not in blocks:
                taken.append(parameter)
                continue
            block, name = blocks[found[1]], found[2]
            members = ", ".join(_parameters(block, name, defined))
            if members:
                taken.append(parameter[: found.start()] + members)
                made = _initialiser(block, name, defined)
                structs_made.append(f" const {found[1]} {name} = {made};")
            else:
                taken[-1] += parameter[: found.start()]
        start, end = (at - kernel.start() for at in kernel.span(1))
        return kernel[0][:start] + ",".join(taken) + kernel[0][end:] + "".join(structs_made)

    return _KERNEL.sub(flat, text)


def split_parameters(text: str) -> list[str]:
    """Split a parameter list at its commas, but not inside of parentheses."""
    parts, depth = [""], 0
    for character in text:
        depth += {"(": 1, ")": -1}.get(character, 0)
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return parts
