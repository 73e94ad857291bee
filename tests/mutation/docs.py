"""The section of docs/testing.md that tells which mutants were killed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.mutation.mutant import Mutant, read

_START, _END = "<!-- mutants: made by tests/mutation/run.py -->", "<!-- end of mutants -->"


def _table(root: Path, mutants: Sequence[Mutant], killed: Mapping[str, bool]) -> list[str]:
    rows: dict[str, list[bool]] = {}
    guards: dict[str, set[str]] = {}
    for mutant in mutants:
        rows.setdefault(mutant.file, []).append(killed[mutant.label(read(root, mutant))])
        guards.setdefault(mutant.file, set()).update(mutant.tests)
    lines = ["| file | mutants | killed | by |", "|---|---|---|---|"]
    for file, verdicts in rows.items():
        tests = ", ".join(f"`{name.removeprefix('tests/')}`" for name in sorted(guards[file]))
        lines.append(f"| `{file}` | {len(verdicts)} | {sum(verdicts)} | {tests} |")
    return lines


def _survivors(root: Path, mutants: Sequence[Mutant], killed: Mapping[str, bool]) -> list[str]:
    lines = []
    for mutant in mutants:
        label = mutant.label(read(root, mutant))
        if not killed[label]:
            why = mutant.equivalent or "Not explained: a test is missing."
            lines.append(f"- `{label}`  \n  {why}")
    return lines


def write_section(root: Path, mutants: Sequence[Mutant], killed: Mapping[str, bool]) -> None:
    """Put the results between the marks of docs/testing.md; mutants not tried are counted there."""
    lines = []
    for title, listed in (
        ("Planted in the kernels", [m for m in mutants if m.file.startswith("cl/")]),
        ("Sampled from numeric Python", [m for m in mutants if not m.file.startswith("cl/")]),
    ):
        part = [mutant for mutant in listed if mutant.label(read(root, mutant)) in killed]
        dead = sum(killed[mutant.label(read(root, mutant))] for mutant in part)
        share = f"{100 * dead / max(len(part), 1):.0f}%"
        lines += [f"{title}: {len(listed)}, tried: {len(part)}, killed: {dead} ({share})."]
        left = dict.fromkeys(f"`{mutant.file}`" for mutant in listed if mutant not in part)
        lines += ["", f"Not all tried yet: {', '.join(left)}."] if left else []
        survivors = _survivors(root, part, killed)
        lines += ["", *_table(root, part, killed), ""]
        lines += ["Survivors:", "", *survivors, ""] if survivors else []
    path = root / "docs" / "testing.md"
    text = path.read_text(encoding="utf-8")
    before, after = text.split(_START)[0], text.split(_END)[1]
    path.write_text(before + "\n".join([_START, "", *lines, _END]) + after, encoding="utf-8")
