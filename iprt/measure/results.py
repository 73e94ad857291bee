"""Results as JSON and as tables."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from pydantic_core import to_jsonable_python

from iprt.output.grid import Grid


def json_text(results: object) -> str:
    """Format plain data, dataclasses and pydantic models as JSON; NaN and infinity become null."""
    # Not pydantic's own `to_json`, which refuses file names that are no text.
    return json.dumps(to_jsonable_python(results, inf_nan_mode="null"), indent=2)


def grid_of(title: str, rows: Sequence[Mapping[str, str]], *notes: str, words: int = 1) -> Grid:
    """Build a table from rows that map columns to texts. Missing cells are empty.

    Columns are in the order of the longest row, then of the others.

    Parameters
    ----------
    words : int
        Number of leading columns of words; see `Grid`.
    """
    columns = tuple(
        dict.fromkeys(column for row in sorted(rows, key=len, reverse=True) for column in row)
    )
    cells = tuple(tuple(row.get(column, "") for column in columns) for row in rows)
    return Grid(title, columns, cells, notes, words)
