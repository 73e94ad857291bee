#!/usr/bin/env python3
"""Fill the tables of a page: `python docs/measure.py docs/tradeoff.md [PART OF A COMMAND]`.

Each bash block of the page holds one `iprt` command that prints Markdown. The lines between
`<!-- measured -->` and `<!-- end -->` after it are replaced by the command's output. After
`<!-- measured, plots NAME -->` the plots of its report follow the table; they are written to
`NAME-1.svg` and so on in the folder of the page's name. The page is written after every command:
an interrupt loses nothing that was measured. With a second argument, only commands that contain it
are run.
"""

from __future__ import annotations

import base64
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from iprt.files.atomic import replacing

BLOCK = re.compile(
    r"```bash\n(?P<command>iprt [^`]*?)\n```"
    r"(?P<between>.*?<!-- measured(?:, plots (?P<plots>[a-z-]+))? -->\n)(?P<table>.*?)<!-- end -->",
    re.DOTALL,
)
PLOT = re.compile(r'data="data:image/svg\+xml;base64,([^"]+)" role="img" aria-label="([^"]*)"')


def commands(page: str) -> dict[str, str | None]:
    """Return the commands of a page that have a table, in order, with the name of their plots."""
    return {match["command"]: match["plots"] for match in BLOCK.finditer(page)}


def write_plots(report: str, page: Path, name: str) -> str:
    """Write the plots of an HTML report beside the page; return Markdown that shows them."""
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    shown = []
    for number, match in enumerate(PLOT.finditer(report), start=1):
        path = folder / f"{name}-{number}.svg"
        with replacing(path) as temporary:
            temporary.write_bytes(base64.b64decode(match[1]))
        shown.append(f"![{match[2]}]({folder.name}/{path.name})")
    return "\n".join(shown)


def filled(page: str, command: str, table: str) -> str:
    """Return the page with the table of one of its commands replaced."""

    def replace(match: re.Match[str]) -> str:
        if match["command"] != command:
            return match[0]
        return f"```bash\n{command}\n```{match['between']}\n{table}\n<!-- end -->"

    return BLOCK.sub(replace, page)


def measured(command: str, page: Path, plots: str | None) -> str:
    """Run a command; return its output with its plots."""
    words = [sys.executable, "-m", *shlex.split(command.replace("\\\n", " "))]
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, "report.html")
        if plots is not None:
            words += ["--html", str(report)]
        table = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True).stdout
        if plots is None:
            return table
        return f"{table}\n{write_plots(report.read_text(encoding='utf-8'), page, plots)}\n"


def main(path: Path, only: str = "") -> None:
    for command, plots in commands(path.read_text(encoding="utf-8")).items():
        if only not in command:
            continue
        print(f"\n{command}", file=sys.stderr)
        start = time.monotonic()
        table = measured(command, path, plots)
        # Read again: the page may have been edited in the meantime.
        page = filled(path.read_text(encoding="utf-8"), command, table)
        with replacing(path) as temporary:
            temporary.write_text(page, encoding="utf-8")
        print(f"took {time.monotonic() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:3])
