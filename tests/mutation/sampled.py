"""Defects sampled from the program's arithmetic: operators, comparisons, constants, signs.

Every place in the files of `GUARDED` where one such thing can be exchanged comes from the syntax
tree; a fixed seed takes some of each file.
"""

from __future__ import annotations

import ast
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from tests.mutation.mutant import Mutant

SEED = 20240

# File, how many of its mutants, tests that guard it.
GUARDED = {
    "iprt/footage/prepare/openings.py": (
        5,
        ("tests/footage/prepare/test_fill.py", "tests/scene/test_scene.py"),
    ),
    "iprt/footage/window_environment.py": (2, ("tests/footage/test_window_environment.py",)),
    "iprt/footage/push_pull.py": (
        4,
        ("tests/footage/test_push_pull.py", "tests/footage/test_window_environment.py"),
    ),
    "iprt/footage/normals.py": (
        8,
        ("tests/footage/test_normals.py", "tests/world/real/test_surfaces.py"),
    ),
    "iprt/footage/prepare/fill.py": (
        7,
        ("tests/footage/prepare/test_fill.py", "tests/scene/test_scene.py"),
    ),
    "iprt/geometry/camera.py": (4, ("tests/geometry/test_camera.py",)),
    "iprt/geometry/equirect.py": (
        4,
        ("tests/geometry/test_camera.py", "tests/geometry/test_equirect.py"),
    ),
    "iprt/bvh/build.py": (3, ("tests/bvh/test_tree.py", "tests/bvh/test_traversal.py")),
    "iprt/bvh/scene.py": (
        5,
        (
            "tests/bvh/test_traversal.py",
            "tests/bvh/test_hit_points.py",
            "tests/frame/test_memory.py",
        ),
    ),
    "iprt/bvh/tree.py": (6, ("tests/bvh/test_tree.py",)),
    "iprt/bvh/wide.py": (3, ("tests/bvh/test_tree.py", "tests/bvh/test_traversal.py")),
    "iprt/world/real/lights.py": (
        4,
        ("tests/world/real/test_lights.py", "tests/world/real/test_irradiance.py"),
    ),
    "iprt/measure/metrics.py": (7, ("tests/measure/test_metrics.py",)),
    "iprt/measure/intervals.py": (2, ("tests/measure/test_intervals.py",)),
    "iprt/measure/pareto.py": (2, ("tests/measure/test_pareto.py",)),
    "iprt/truth/sensor.py": (4, ("tests/truth/test_sensor.py",)),
}

# Why no test tells a mutant from the program, by its label.
EQUIVALENT: dict[str, str] = {
    "iprt/truth/sensor.py: [[*rotation[0], 0.0], [*rotation[1], 0.0], [*rotation[2], 0.0], "
    "[0, 0, 0, 1.0]] -> [[*rotation[0], 0.0], [*rotation[1], 0.0], [*rotation[2], 0.1], "
    "[0, 0, 0, 1.0]]": ("Only directions are transformed: rays start at the origin."),
    "iprt/truth/sensor.py: [[*rotation[0], 0.0], [*rotation[1], 0.0], [*rotation[2], 0.0], "
    "[0, 0, 0, 1.0]] -> [[*rotation[0], 0.0], [*rotation[1], 0.0], [*rotation[2], 0.0], "
    "[0, 0, 0, 2.1]]": ("The same."),
}

_BINARY: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "//"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}
_COMPARISON: dict[type[ast.cmpop], tuple[str, str]] = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
}


class _Places(ast.NodeVisitor):
    """Places of a source text where something can be exchanged: (start, old, new)."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._lines = [0]
        for line in text.splitlines(keepends=True):
            self._lines.append(self._lines[-1] + len(line))
        self.found: list[tuple[int, str, str]] = []

    def _at(self, line: int, column: int) -> int:
        start = self._lines[line - 1]
        encoded = self._text[start : self._lines[line]].encode()
        return start + len(encoded[:column].decode())

    def _between(self, left: ast.expr, right: ast.expr, old: str, new: str) -> None:
        start = self._at(left.end_lineno or 0, left.end_col_offset or 0)
        end = self._at(right.lineno, right.col_offset)
        place = self._text.find(old, start, end)
        if place >= 0:
            self.found.append((place, old, new))

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if type(node.op) in _BINARY:
            self._between(node.left, node.right, *_BINARY[type(node.op)])
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        left = node.left
        for op, right in zip(node.ops, node.comparators, strict=True):
            if type(op) in _COMPARISON:
                self._between(left, right, *_COMPARISON[type(op)])
            left = right
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        old = {ast.USub: "-", ast.Invert: "~"}.get(type(node.op))
        if old:
            self.found.append((self._at(node.lineno, node.col_offset), old, ""))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if type(node.value) in (int, float):
            start = self._at(node.lineno, node.col_offset)
            end = self._at(node.end_lineno or 0, node.end_col_offset or 0)
            changed = node.value + 1 if isinstance(node.value, int) else 2.0 * node.value + 0.1
            self.found.append((start, self._text[start:end], repr(changed)))

    def visit_Raise(self, node: ast.Raise) -> None:
        """Wording of errors is no arithmetic."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Nor is other text."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for default in node.args.defaults:
            self.visit(default)
        for statement in node.body:
            self.visit(statement)


def mutants(root: Path) -> Iterator[Mutant]:
    """The sampled mutants of the checkout at `root`."""
    for file, (count, tests) in GUARDED.items():
        text = (root / file).read_text(encoding="utf-8")
        places = _Places(text)
        places.visit(ast.parse(text))
        found = sorted(set(places.found))
        chosen = random.Random(f"{SEED} {file}").sample(found, min(count, len(found)))
        for start, old, new in sorted(chosen):
            mutant = Mutant(file, old, new, tests, start)
            yield replace(mutant, equivalent=EQUIVALENT.get(mutant.label(text), ""))
