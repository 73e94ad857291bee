"""Source of kernels, as the compiler of a variant sees it."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path

from iprt.errors import KernelError
from iprt.files.resources import CL

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
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


@dataclass(frozen=True)
class _Macro:
    parameters: tuple[str, ...] | None  # None: it is not called
    text: str


@dataclass
class KernelSource:
    """A file after preprocessing, and the macros that are defined there.

    Attributes
    ----------
    folder : Path
        Where files are that are included.
    """

    folder: Path
    macros: dict[str, _Macro] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    def define(self, macros: Mapping[str, str]) -> None:
        """Macros that the compiler is given."""
        self.macros.update({name: _Macro(None, text) for name, text in macros.items()})

    def read(self, text: str) -> None:
        """OpenCL C."""
        self._read(_without_comments(text))

    def _read(self, text: str) -> None:
        taken = [True]  # whether lines are, by depth of #if
        done = [True]  # whether a branch was
        for line in text.splitlines():
            match = _DIRECTIVE.match(line)
            if match is None:
                if all(taken):
                    self.lines.append(line)
                continue
            word, rest = match.groups()
            if word in ("if", "ifdef", "ifndef"):
                here = all(taken) and self._holds(word, rest)
                taken.append(here)
                done.append(here)
            elif word in ("else", "elif"):
                taken.pop()
                here = not done[-1] and all(taken) and (word == "else" or self._holds("if", rest))
                taken.append(here)
                done[-1] |= here
            elif word == "endif":
                taken.pop()
                done.pop()
            elif all(taken):
                self._direct(word, rest)

    def _direct(self, word: str, rest: str) -> None:
        if word == "include":
            self._read(_text(self.folder / rest.strip('"')))
        elif word == "define":
            name, called, text = _MACRO.fullmatch(rest.strip()).groups()  # type: ignore[union-attr]
            names = None if called is None else tuple(n.strip() for n in called[1:-1].split(","))
            self.macros[name] = _Macro(names, text)
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
        """With macros replaced until there are none."""
        for name, macro in self.macros.items():
            if macro.parameters is not None:
                text = re.sub(rf"\b{name}\(([^()]*)\)", partial(_called, macro), text)
        found = _WORD.sub(lambda m: self._replacement(m[0]), text)
        return found if found == text else self.expanded(found)

    def _replacement(self, word: str) -> str:
        macro = self.macros.get(word)
        return word if macro is None or macro.parameters is not None else macro.text


def _value(node: ast.expr) -> int:
    """A condition of `#if`, in Python's words."""
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
    return _COMMENT.sub(" ", text).replace("\\\n", " ")


def constant(file: str, name: str) -> int:
    """The integer that a file of `cl/` defines `name` to be, which is its one home."""
    return int(_source(file).expanded(name))


def float_constant(file: str, name: str) -> float:
    """The same of a number in single precision, such as 0.1f."""
    return float(_source(file).expanded(name).removesuffix("f"))


@cache
def _source(file: str) -> KernelSource:
    read = KernelSource(CL / "lib")
    read.read((CL / file).read_text())
    return read
