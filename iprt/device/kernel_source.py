"""Source of kernels with includes and conditions resolved.

Variants whose defines change nothing have the same text, wherever the checkout lies. Drivers cache
compiled kernels by their text, so they compile each once.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from pathlib import Path

from iprt.device.block import Block, flat_kernels, struct_name, structs
from iprt.errors import KernelError
from iprt.files.resources import CL

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
_CONTINUED = re.compile(r"(?:[^\n]*\\\n)+[^\n]*")
_DIRECTIVE = re.compile(r"\s*#\s*(\w+)\s*(.*)")
_MACRO = re.compile(r"(\w+)(\([^)]*\))?\s*(.*)")
_DEFINED = re.compile(r"defined\s*\(?\s*(\w+)\s*\)?")
_RELATIONS: dict[type[ast.cmpop], Callable[[int, int], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_WORD = re.compile(r"\b[A-Za-z_]\w*\b")
_MOST_BLANK = 4
"""Longest run of blank lines in place of removed lines; longer runs become a `#line`."""


@dataclass(frozen=True)
class _Macro:
    parameters: tuple[str, ...] | None  # None for an object-like macro
    text: str


@dataclass
class _Condition:
    """The state of a conditional block during reading.

    Attributes
    ----------
    taken : bool
        The current branch is active.
    done : bool
        One of its branches was active.
    compilers : bool
        Only the compiler can decide it, so that all branches are kept.
    """

    taken: bool
    done: bool
    compilers: bool


@dataclass
class KernelSource:
    """A source text with resolved includes and conditions, and the macros that it defines.

    Macros are not expanded. Conditions on names of the compiler, such as `__has_attribute`, stay.

    Attributes
    ----------
    folder : Path
        Folder of the headers that all files share, `cl/lib`.
    macros : dict
        Macros by name.
    blocks : dict
        Blocks of included Python modules, by the names of their structs.
    lines : list of str
        The source, with `#line` after removed lines.
    """

    folder: Path
    macros: dict[str, _Macro] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    blocks: dict[str, type[Block]] = field(default_factory=dict)
    _place: tuple[str, int] = ("", 0)  # the compiler's file and number of the next line
    _undecided: set[str] = field(default_factory=set)  # macros that the compiler may define

    def define(self, macros: Mapping[str, str]) -> None:
        """Add macros that the compiler gets by `-D`."""
        self.macros.update({name: _Macro(None, text) for name, text in macros.items()})

    def read(self, text: str, name: str) -> None:
        """Add OpenCL C; compilers report its errors under `name`."""
        self._read(_without_comments(text), name)

    @property
    def text(self) -> str:
        """The resolved source, in which kernels take the members of blocks."""
        return flat_kernels("\n".join(self.lines) + "\n", self.blocks, self.macros)

    def _read(self, text: str, name: str) -> None:
        open_blocks: list[_Condition] = []
        for number, line in enumerate(text.splitlines(), 1):
            match = _DIRECTIVE.match(line)
            taken = all(block.taken for block in open_blocks)
            if match is not None and match[1] in ("if", "ifdef", "ifndef"):
                block = self._begin(match[1], match[2]) if taken else _Condition(False, True, False)
                open_blocks.append(block)
                keep = block.compilers
            elif match is not None and match[1] in ("else", "elif", "endif"):
                keep = self._go_on(open_blocks, match[1], match[2])
            elif match is None or not taken:
                keep = taken and bool(line.strip())
            elif match[1] == "include" and match[2].startswith("<"):
                self._emit_structs(match[2].strip().strip("<>"))
                keep = False
            elif match[1] == "include":
                self._read(*self._included(match[2].strip().strip('"'), name))
                keep = False
            else:
                maybe = any(block.compilers for block in open_blocks)
                self._direct(match[1], match[2], maybe=maybe)
                keep = True
            if keep:
                self._emit(line, name, number)

    def _emit_structs(self, module: str) -> None:
        """Define the structs of the blocks that a Python module declares."""
        for block in vars(import_module(module)).values():
            if isinstance(block, type) and block.__module__ == module and issubclass(block, Block):
                for struct in structs(block, self.macros, self.blocks):
                    for number, line in enumerate(struct.splitlines(), 1):
                        self._emit(line, f"{struct_name(block)} of {module}", number)

    def _included(self, file: str, name: str) -> tuple[str, str]:
        """Return the text and name of a header beside the file `name`, else of a shared one."""
        beside = Path(name).parent / file
        if (self.folder.parent / beside).is_file():
            return _text(self.folder.parent / beside), beside.as_posix()
        return _text(self.folder / file), f"lib/{file}"

    def _emit(self, line: str, name: str, number: int) -> None:
        file, next_number = self._place
        if file == name and 0 <= number - next_number <= _MOST_BLANK:
            self.lines += [""] * (number - next_number)
        else:
            self.lines.append(f'#line {number} "{name}"')
        self.lines.append(line)
        self._place = (name, number + 1)

    def _begin(self, word: str, condition: str) -> _Condition:
        names = _WORD.findall(condition)
        if any(name.startswith("__") or name in self._undecided for name in names):
            return _Condition(taken=True, done=False, compilers=True)
        holds = self._holds(word, condition)
        return _Condition(taken=holds, done=holds, compilers=False)

    def _go_on(self, open_blocks: list[_Condition], word: str, condition: str) -> bool:
        """Process `#else`, `#elif` or `#endif`; return True if the compiler needs the line."""
        block = open_blocks[-1]
        if word == "endif":
            open_blocks.pop()
        elif not block.compilers:
            block.taken = not block.done and (word == "else" or self._holds("if", condition))
            block.done |= block.taken
        return block.compilers

    def _direct(self, word: str, rest: str, *, maybe: bool) -> None:
        """Record a macro; with `maybe`, the compiler decides whether the line is active."""
        if word == "define":
            name, called, text = _MACRO.fullmatch(rest.strip()).groups()  # type: ignore[union-attr]
            names = None if called is None else tuple(n.strip() for n in called[1:-1].split(","))
            self.macros[name] = _Macro(names, text)
            if maybe:
                self._undecided.add(name)
        elif word == "undef":
            self.macros.pop(rest.strip(), None)

    def _holds(self, word: str, condition: str) -> bool:
        if word != "if":
            return (condition.strip() in self.macros) == (word == "ifdef")
        known = _DEFINED.sub(lambda m: str(int(m[1] in self.macros)), condition)
        number = _WORD.sub(lambda m: self.expanded(m[0]) if m[0] in self.macros else "0", known)
        number = number.replace("&&", " and ").replace("||", " or ")
        number = re.sub(r"!(?!=)", " not ", number)
        return bool(_value(ast.parse(number.strip(), mode="eval").body))

    def expanded(self, text: str) -> str:
        """Return `text` with all macros expanded."""
        for name, macro in self.macros.items():
            if macro.parameters is not None:
                text = re.sub(rf"\b{name}\(([^()]*)\)", partial(_called, macro), text)
        found = _WORD.sub(lambda m: self._replacement(m[0]), text)
        return found if found == text else self.expanded(found)

    def _replacement(self, word: str) -> str:
        macro = self.macros.get(word)
        return word if macro is None or macro.parameters is not None else macro.text


def _value(node: ast.expr) -> int:
    """Evaluate a condition of `#if`, given as a Python expression."""
    match node:
        case ast.Constant(int(value)):
            return value
        case ast.BoolOp(ast.And(), parts):
            return int(all(map(_value, parts)))
        case ast.BoolOp(ast.Or(), parts):
            return int(any(map(_value, parts)))
        case ast.UnaryOp(ast.Not(), part):
            return int(not _value(part))
        case ast.Compare(left, [relation], [right]) if type(relation) in _RELATIONS:
            return int(_RELATIONS[type(relation)](_value(left), _value(right)))
    raise KernelError(f"a condition of a kernel's #if is not understood: {ast.unparse(node)}")


def _called(macro: _Macro, call: re.Match[str]) -> str:
    text = macro.text
    given = (argument.strip() for argument in call[1].split(","))
    for name, argument in zip(macro.parameters or (), given, strict=True):
        text = re.sub(rf"##\s*{name}\b|\b{name}\s*##|\b{name}\b", argument, text)
    return text


@cache
def _text(file: Path) -> str:
    return _without_comments(file.read_text())


def _without_comments(text: str) -> str:
    """Remove comments and join continued lines, without changing line numbers."""
    text = _COMMENT.sub(lambda comment: " " + "\n" * comment[0].count("\n"), text)
    text = re.sub(r"[ \t]+(?=\n)", "", text)
    return _CONTINUED.sub(
        lambda lines: lines[0].replace("\\\n", " ") + "\n" * lines[0].count("\\\n"), text
    )


def constant(file: str, name: str) -> int:
    """Return the integer that a file of `cl/` defines as `name`."""
    return int(_constants(file)[name])


def float_constant(file: str, name: str) -> float:
    """Return the single-precision constant, such as 0.1f, that a file of `cl/` defines."""
    return float(_constants(file)[name].removesuffix("f"))


@cache
def _constants(file: str) -> dict[str, str]:
    return dict(re.findall(r"^#define (\w+) (\S+)", (CL / file).read_text(), re.MULTILINE))
