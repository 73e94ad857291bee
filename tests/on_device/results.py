"""What is known so far: on the screen, and in two files that are always whole."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.on_device.cases import Row, Value
from tests.on_device.runner import Outcome, Step

MEASURED = "gpu_measured.json"
"""What `docs/gpu.py` takes."""


def say(text: str) -> None:
    """Print it at once."""
    print(text, flush=True)


@dataclass
class Results:
    """All of them.

    Attributes
    ----------
    folder : Path
        Takes `results.json`, `results.md`, and `gpu_measured.json` when there is something for it.
    machine : list of str
        Lines about drivers and packages.
    """

    folder: Path
    steps: list[Step]
    machine: list[str] = field(default_factory=list)
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    began_s: float = field(default_factory=time.monotonic)

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        self.outcomes = {step.name: Outcome() for step in self.steps}

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.began_s

    def note(self, line: str) -> None:
        """A line about the machine."""
        say(line)
        self.machine.append(line)
        self.write()

    def ended(self, step: Step, case: str) -> None:
        """A case has come to an end."""
        outcome = self.outcomes[step.name]
        done = outcome.done[case]
        if "problem" in done:
            say(f"  {case}: FAILED: {done['problem']}")
        for row in outcome.rows(case):
            told = [f"{key} {_text(value)}" for key, value in _shown(row).items()]
            say(f"  {case}: {', '.join(told)}")
        self.write()

    def write(self) -> None:
        """Write all files anew."""
        record = {
            "seconds": round(self.seconds, 1),
            "machine": self.machine,
            "steps": {name: self._record(one) for name, one in self.outcomes.items()},
        }
        self._replace("results.json", json.dumps(record, indent=1) + "\n")
        self._replace("results.md", self.page())
        measured = self.outcomes["model"].done if "model" in self.outcomes else {}
        devices = [one["rows"][0]["measured"] for one in measured.values() if one.get("rows")]
        if devices:
            self._replace(MEASURED, json.dumps({"devices": devices}, indent=1) + "\n")

    def _record(self, outcome: Outcome) -> dict[str, Any]:
        return {"failed": outcome.failed, "cases": outcome.done, "left": outcome.left}

    def _replace(self, name: str, text: str) -> None:
        # A cut may come at any time.
        temporary = self.folder / f"{name}.part"
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(self.folder / name)

    def page(self) -> str:
        """For people."""
        lines = ["# Measured on a device", "", *(f"- {line}" for line in self.machine)]
        for step in self.steps:
            outcome = self.outcomes[step.name]
            lines += ["", f"## {step.title}", "", *_table(outcome)]
            lines += [
                f"- failed: {name}: {done['problem']}"
                for name, done in outcome.done.items()
                if "problem" in done
            ]
            if not outcome.finished or outcome.failed:
                left = ", ".join(outcome.left) or "all of it"
                lines.append(f"- {outcome.failed or f'did not fit into the time: {left}'}")
        return "\n".join(lines) + "\n"


def _table(outcome: Outcome) -> list[str]:
    rows = [{"case": name, **_shown(row)} for name in outcome.done for row in outcome.rows(name)]
    columns = list(dict.fromkeys(key for row in rows for key in row))
    if not rows:
        return []
    lines = [_line(columns), _line(["---"] * len(columns))]
    return [*lines, *(_line([_text(row.get(key)) for key in columns]) for row in rows), ""]


def _shown(row: Row) -> dict[str, Value]:
    return {key: value for key, value in row.items() if not isinstance(value, dict)}


def _text(value: Value) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"
