"""Parsing of untrusted TOML, bounded in size, time and depth."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from iprt.files.message_text import printable

MAX_BYTES = 2**20
MAX_LINE = 10_000
"""Letters per line; the time of `tomllib` grows with the square of a line's length."""
MAX_DEPTH = 32


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text into tables.

    Raises
    ------
    ValueError
        The text is not TOML, too large, too deep, or has numbers of more than 64 bits; one line.
    """
    if len(text) > MAX_BYTES:
        raise ValueError(f"not valid: {len(text)} letters; at most {MAX_BYTES} are read")
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > MAX_LINE:
            raise ValueError(f"not valid: line {number} has more than {MAX_LINE} letters")
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"not valid TOML: {printable(str(error))}") from None
    except RecursionError:
        raise ValueError("not valid: brackets are nested too deep") from None
    except ValueError:  # Python refuses numbers of thousands of digits
        raise ValueError("not valid TOML: a number of more than 64 bits") from None
    _require_plain(tables)
    return tables


def _require_plain(tables: dict[str, Any]) -> None:
    """Raise ValueError for integers of more than 64 bits, and for tables nested too deep."""
    level: list[tuple[str, Any]] = [("", tables)]
    for _ in range(MAX_DEPTH):
        below: list[tuple[str, Any]] = []
        for where, value in level:
            if isinstance(value, dict):
                below.extend((f"{where}.{key}", entry) for key, entry in value.items())
            elif isinstance(value, list):
                below.extend((where, entry) for entry in value)
            elif isinstance(value, int) and not -(2**63) <= value < 2**63:
                key = printable(where[1:])
                raise ValueError(f"not valid TOML: {key}: a number of more than 64 bits")
        level = below
        if not level:
            return
    raise ValueError("not valid: tables are nested too deep")


def read_text(path: Path) -> str:
    """Read the text of a TOML file, with its line ends but without a byte order mark.

    Raises
    ------
    OSError, ValueError
        The file is unreadable; or it is not UTF-8, not a file, or too large, in one line.
    """
    # A pipe or a device has no end, and opening one may block.
    if path.exists() and not path.is_file() and not path.is_dir():
        raise ValueError("not a file")
    with path.open("rb") as file:
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise ValueError(f"too large; at most {MAX_BYTES} bytes are read")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ValueError(f"line {line} is not UTF-8; save the file as UTF-8") from None
