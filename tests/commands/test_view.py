"""`iprt view`: what its flags refuse."""

from __future__ import annotations

from pathlib import Path

import pytest

from iprt import cli
from tests.clips import write_clip


@pytest.mark.parametrize(
    ("flags", "told"),
    [
        ("--view nowhere", "--view nowhere: clip has no such view"),
        ("--yaw nan", "--yaw nan: expected"),
        ("--size 0 0", "--size 0 0: expected"),
        ("--fps nan", "--fps nan: expected"),
        ("--web --port 65536", "--port 65536: expected 0 to 65535"),
        ("--web --port -1", "--port -1: expected 0 to 65535"),
        ("--port 9000", "--port: is for --web"),
    ],
)
def test_flags_that_cannot_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], flags: str, told: str
) -> None:
    scene = write_clip(tmp_path / "clip", 1)
    assert cli.main(["view", str(scene), *flags.split()]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert told in err
    assert err.count("\n") == 1
