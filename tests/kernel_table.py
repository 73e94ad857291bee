"""The table of docs/testing.md that lists the tests that guard each kernel file.

Run `python -m tests.kernel_table` to print it, and with `--write` to put it into the page. A test
guards a file if it fails on a defect that tests/mutation/kernels.txt plants there.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path

from tests.mutation.kernels import planted

PAGE = Path(__file__).parents[1] / "docs" / "testing.md"
START, END = "<!-- kernels: printed by tests/kernel_table.py -->", "<!-- end of kernels -->"


def table() -> str:
    """Return the table in Markdown: files that the same tests guard share a row."""
    guards: dict[str, set[str]] = defaultdict(set)
    for mutant in planted():
        guards[mutant.file].update(mutant.tests)
    rows: dict[frozenset[str], list[str]] = defaultdict(list)
    for file in sorted(guards):
        rows[frozenset(guards[file])].append(file)
    lines = ["| kernel | guarded by |", "|---|---|"]
    for tests, files in rows.items():
        lines.append(f"| {_listed(files)} | {_listed(sorted(tests))} |")
    return "\n".join(lines)


def _listed(names: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _main(arguments: list[str]) -> None:
    if arguments != ["--write"]:
        print(table())
        return
    text = PAGE.read_text(encoding="utf-8")
    before, after = text.split(START)[0], text.split(END)[1]
    PAGE.write_text(f"{before}{START}\n\n{table()}\n\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    _main(sys.argv[1:])
