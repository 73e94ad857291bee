"""Blocks of kernel arguments: one declaration for the struct, the parameters and their binding.

A kernel takes a block like any struct, `const World world`. OpenCL allows no pointers in structs
that kernels take, so `flat_kernels` replaces it by a parameter per member, such as
`world_real_grid_width`, and begins the kernel's body with the struct made of them. A launch takes
an instance: `kernel(size, world=WorldArgs(...))`.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import pyopencl.array as cla

Int32 = Annotated[int, "const int"]
Float32 = Annotated[float, "const float"]
Int4 = Annotated[Any, "const int4"]
Float2 = Annotated[Any, "const float2"]
Float4 = Annotated[Any, "const float4"]
Floats = Annotated[cla.Array | None, "__global const float *restrict"]
Float2s = Annotated[cla.Array | None, "__global const float2 *restrict"]
Float4s = Annotated[cla.Array | None, "__global const float4 *restrict"]
Halves = Annotated[cla.Array | None, "__global const half *restrict"]
Bytes = Annotated[cla.Array | None, "__global const uchar *restrict"]
Ints = Annotated[cla.Array | None, "__global const int *restrict"]
Int4s = Annotated[cla.Array | None, "__global const int4 *restrict"]
Uints = Annotated[cla.Array | None, "__global const uint *restrict"]
Counters = Annotated[cla.Array | None, "__global uint *restrict"]
FloatsOut = Annotated[cla.Array | None, "__global float *restrict"]
Float4sOut = Annotated[cla.Array | None, "__global float4 *restrict"]
IntsOut = Annotated[cla.Array | None, "__global int *restrict"]
Int4sOut = Annotated[cla.Array | None, "__global int4 *restrict"]
"""Types of members: numbers, vectors and buffers of these. None is a null pointer."""

_KERNEL = re.compile(r"\b(?:__kernel|TRACING_KERNEL)\s+void\s+\w+\s*\(([^{]*)\)\s*\{")
_TAKEN = re.compile(r"(\s*)(.*?)\s*\b(\w+)(?:\[(\w+)\])?\s*", re.DOTALL)


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


def struct_name(block: type[Block]) -> str:
    """Return the name of the block's struct."""
    return block.__name__.removesuffix("Args")


def structs(block: type[Block], known: dict[str, type[Block]]) -> Iterator[str]:
    """Yield the lines of a block's struct and of nested ones, without the `known` ones.

    `known` gets their blocks by name. Programs that lack a member have it in the struct as 0.
    """
    if struct_name(block) in known:
        return
    lines = []
    for member in _members(block):
        kind = member.kind
        if isinstance(kind, type):
            yield from structs(kind, known)
            kind = struct_name(kind)
        kind = kind.removeprefix("const ").removesuffix("restrict")
        lines.append(f"    {kind} {member.name};")
    known[struct_name(block)] = block
    yield from ("typedef struct {", *lines, f"}} {struct_name(block)};")


def _leaves(
    block: type[Block], name: str, macros: Mapping[str, str]
) -> Iterator[tuple[str, str, Member]]:
    """Yield designator, flat name and description of all members that a program has."""
    for member in _members(block):
        words = member.when.split()
        if any((word.lstrip("!") in macros) == word.startswith("!") for word in words):
            continue
        if isinstance(member.kind, type):
            for path, flat, leaf in _leaves(member.kind, f"{name}_{member.name}", macros):
                yield f".{member.name}{path}", flat, leaf
        else:
            yield f".{member.name}", f"{name}_{member.name}", member


def flat_kernels(text: str, blocks: Mapping[str, type[Block]], macros: Mapping[str, str]) -> str:
    """Return OpenCL C whose kernels take members of blocks, and single entries of batches.

    A batch `TYPE name[MOST_ENTRIES]` becomes the parameters `name_0`, `name_1` and so on. In the
    body, `name` is the one of the work item's `entry`, its place along the third dimension. Line
    numbers stay.

    Parameters
    ----------
    text : str
    blocks : mapping
        By the names of their structs.
    macros : mapping of str to str
        Macros for `when()`.
    """
    sizes: dict[str, str] = dict(re.findall(r"^#define (\w+) (\d+)$", text, re.MULTILINE))

    def flat(kernel: re.Match[str]) -> str:
        parameters: list[str] = []
        body: list[str] = []
        for parameter in kernel[1].split(","):
            found = _TAKEN.fullmatch(parameter)
            block = blocks.get(found[2].removeprefix("const ")) if found else None
            if found is None or not (block or found[4]):
                parameters.append(parameter)
                continue
            space, kind, name, size = found.groups()
            if block:
                declared, value = _split(block, name, macros)
            else:
                entries = [f"{name}_{i}" for i in range(int(sizes.get(size, size)))]
                declared, value = [f"{kind} {entry}" for entry in entries], _chosen(entries)
            if declared:
                parameters.append(space + ", ".join(declared))
            else:
                parameters[-1] += space
            body.append(f"{kind} {name} = {value};")
        if any("entry == " in statement for statement in body):
            body.insert(0, "const int entry = get_global_id(2);")
        start, end = (at - kernel.start() for at in kernel.span(1))
        return " ".join([kernel[0][:start] + ",".join(parameters) + kernel[0][end:], *body])

    return _KERNEL.sub(flat, text)


def _split(block: type[Block], name: str, macros: Mapping[str, str]) -> tuple[list[str], str]:
    """Return the flat parameters of a block, and the struct made of them."""
    leaves = list(_leaves(block, name, macros))
    members = ", ".join(f"{path} = {leaf.outer or flat}" for path, flat, leaf in leaves)
    declared = [f"{leaf.kind} {flat}" for _, flat, leaf in leaves if not leaf.outer]
    return declared, f"{{{members or '0'}}}"


def _chosen(entries: Sequence[str]) -> str:
    """Return the expression of the work item's entry."""
    *first, last = entries
    return "".join(f"entry == {i} ? {entry} : " for i, entry in enumerate(first)) + last
