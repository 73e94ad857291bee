#!/usr/bin/env python3
"""Fill the tables of a page: `python docs/measure.py docs/tradeoff.md [PART OF A COMMAND]`.

Each bash block of the page holds one `iprt` command that prints Markdown. What stands between the
lines `<!-- measured -->` and `<!-- end -->` after it is replaced by what the command prints. The
page is written after every command, so an interrupt loses nothing that was measured. With a second
argument, only commands that contain it are run.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

from iprt.files.atomic import replacing

BLOCK = re.compile(
    r"```bash\n(?P<command>iprt [^`]*?)\n```"
    r"(?P<between>.*?<!-- measured -->\n)(?P<table>.*?)<!-- end -->",
    re.DOTALL,
)


def commands(page: str) -> list[str]:
    """The commands of a page that have a table, in their order."""
    return [match["command"] for match in BLOCK.finditer(page)]


def filled(page: str, command: str, table: str) -> str:
    """The page with the table of one of its commands."""

    def replace(match: re.Match[str]) -> str:
        if match["command"] != command:
            return match[0]
        return f"```bash\n{command}\n```{match['between']}\n{table}\n<!-- end -->"

    return BLOCK.sub(replace, page)


def main(path: Path, only: str = "") -> None:
    for command in commands(path.read_text(encoding="utf-8")):
        if only not in command:
            continue
        print(f"\n{command}", file=sys.stderr)
        start = time.monotonic()
        words = shlex.split(command.replace("\\\n", " "))
        run = subprocess.run(
            [sys.executable, "-m", *words], stdout=subprocess.PIPE, text=True, check=True
        )
        # Read anew: the page may have been edited in the meantime.
        page = filled(path.read_text(encoding="utf-8"), command, run.stdout)
        with replacing(path) as temporary:
            temporary.write_text(page, encoding="utf-8")
        print(f"took {time.monotonic() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:3])
