"""A clip, and a stand-in for `iprt` that records its arguments."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from iprt import cli
from tests.clips import write_clip

PROGRAM = """#!{python}
import json, pathlib, sys
notes = pathlib.Path({notes!r})
with notes.open("a") as file:
    print(json.dumps(sys.argv[1:]), file=file)
codes = json.loads(notes.with_suffix(".codes").read_text())
sys.exit(codes[min(len(notes.read_text().splitlines()), len(codes)) - 1])
"""


@dataclass(frozen=True)
class Program:
    """A program that writes down its words, and ends with given codes, one after another."""

    file: Path
    notes: Path

    @property
    def calls(self) -> list[list[str]]:
        if not self.notes.exists():
            return []
        return [json.loads(line) for line in self.notes.read_text().splitlines()]

    def ends_with(self, *codes: int) -> None:
        self.notes.unlink(missing_ok=True)
        self.notes.with_suffix(".codes").write_text(json.dumps(codes))


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Program:
    """Put a stand-in for `iprt` into scripts and templates."""
    file, notes = tmp_path / "an iprt", tmp_path / "notes"
    file.write_text(PROGRAM.format(python=sys.executable, notes=str(notes)))
    file.chmod(0o755)
    for user in ("slurm", "openjd", "submission"):
        monkeypatch.setattr(f"iprt.farm.{user}.iprt", lambda: str(file))
    made = Program(file, notes)
    made.ends_with(0)
    return made


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    return write_clip(tmp_path / "a clip", 20)


@pytest.fixture
def printed(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Return a function that runs a verb and returns its output."""

    def run(*words: object) -> str:
        capsys.readouterr()
        assert cli.main([str(word) for word in words]) == 0
        return capsys.readouterr().out

    return run
