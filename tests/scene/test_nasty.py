"""Files made to hurt: each gives its error, soon, and with hardly any memory."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.scene import corpus
from tests.scene.nasty import CORPUS
from tests.waiting import DEADLINE_S

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, str]]:
    folder = tmp_path_factory.mktemp("nasty")
    words = [sys.executable, "-m", corpus.__name__, str(folder)]
    done = subprocess.run(
        words, cwd=ROOT, capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    read: dict[str, tuple[str, str]] = json.loads(done.stdout)
    return read


@pytest.mark.parametrize("name", [entry.name for entry in CORPUS])
def test_nasty_files_give_their_error(name: str, outcome: dict[str, tuple[str, str]]) -> None:
    (entry,) = (entry for entry in CORPUS if entry.name == name)
    kind, text = outcome[name]
    assert kind == "IprtError", text
    assert entry.message in text
    first, *more = text.splitlines()
    assert first.startswith((entry.file, "t.png")) or entry.file == "scene.toml"
    assert all(line.startswith("  ") for line in more)
    assert len(more) <= 100
    assert all(letter.isprintable() for line in text.splitlines() for letter in line)
