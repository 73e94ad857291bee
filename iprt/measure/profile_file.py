"""Cost reports as JSON and CSV, and the reader of earlier JSON files."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, Field, ValidationError

from iprt.errors import FormatError
from iprt.files.atomic import replacing
from iprt.measure.cost_report import SCHEMA, CostReport


def json_text(report: CostReport, changes: Sequence[Mapping[str, Any]] | None = None) -> str:
    """Format a report as JSON, with its `changes` (records of `Change`) if given."""
    record = report.record()
    if changes is not None:
        record["changes"] = list(changes)
    return json.dumps(record, indent=2)


def csv_text(report: CostReport) -> str:
    """Format `CostReport.flat` as CSV with a header line. Values that do not apply are empty."""
    rows = report.flat()
    text = io.StringIO(newline="")
    table = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue()


def write_profile(path: Path, report: CostReport) -> None:
    """Write a report as JSON, atomically.

    Raises
    ------
    FormatError
        The file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(json_text(report) + "\n", encoding="utf-8")


Milliseconds = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class OldTime(BaseModel):
    """A median over frames, and its standard error if known."""

    ms: Milliseconds
    error_ms: Milliseconds | None


class OldPart(OldTime):
    """A kernel, a kind of transfer, or host work; see `PartRow`."""

    name: str
    kind: str


class OldPass(OldTime):
    """A pass; see `PassRow`."""

    name: str
    parts: list[OldPart]


class OldReport(BaseModel):
    """The fields of an earlier `CostReport` that a comparison needs."""

    version: str
    scene: str
    device: str
    view: dict[str, Any]
    frames: int
    wall_ms: Milliseconds | None
    wall_error_ms: Milliseconds | None
    ms: Milliseconds
    error_ms: Milliseconds | None
    passes: list[OldPass]
    settings: dict[str, Any]


def read_profile(path: Path) -> OldReport:
    """Read a file of `iprt profile --json`, `iprt bench --json` or `iprt render --profile`.

    Raises
    ------
    FormatError
        The file cannot be read, or has another format.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FormatError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: is not JSON: {str(error).splitlines()[0]}") from error
    wanted = "expected the output of `iprt profile --json`"
    schema = record.get("schema") if isinstance(record, dict) else None
    if schema is None:
        raise FormatError(f"{path}: {wanted}")
    if schema != SCHEMA:
        raise FormatError(
            f"{path}: has schema {schema}, this version reads {SCHEMA}; measure again with it"
        )
    try:
        return OldReport.model_validate(record)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise FormatError(f"{path}: {place}: {first['msg']}; {wanted}") from error
