"""The numbers of the pass table and of its JSON twin."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from iprt.device.profile import PassTime, Profile
from iprt.output.table import pass_rows, pass_table, write_profile


class FakeProfile(Profile):
    """Two passes over four frames: 24 ms on the device, 8 ms on the host."""

    def __init__(self) -> None:
        super().__init__()
        self.frames = 4
        self.compile_ms = 1234.0

    def passes(self) -> list[PassTime]:
        return [PassTime("raster", 0.0, 8.0, 0), PassTime("march", 24.0, 0.0, 8)]


def test_rows_are_per_frame() -> None:
    raster, march = pass_rows(FakeProfile())
    assert (raster.ms, raster.host_ms, raster.device_ms, raster.launches) == (2.0, 2.0, 0.0, 0.0)
    assert (march.ms, march.device_ms, march.launches) == (6.0, 6.0, 2.0)
    assert (raster.share, march.share) == (0.25, 0.75)


def test_nothing_measured_divides_by_nothing() -> None:
    assert pass_rows(Profile()) == []


def test_table_shows_passes_sum_and_compile_time() -> None:
    stream = io.StringIO()
    Console(file=stream, width=100).print(pass_table(FakeProfile(), "a device", prepare_ms=56.0))
    text = stream.getvalue()
    rows = {line.split()[1]: line for line in text.splitlines() if line[:1] in "│┃"}
    assert "75.0%" in rows["march"]
    assert "6.00" in rows["march"]
    assert "8.00" in rows["sum"]
    assert "4 frames on a device" in text
    assert "1234 ms" in text
    assert "56 ms" in text


def test_profile_file(tmp_path: Path) -> None:
    write_profile(tmp_path / "new" / "profile.json", FakeProfile(), "a device", prepare_ms=56.0)
    record = json.loads((tmp_path / "new" / "profile.json").read_text())
    assert (record["device"], record["frames"], record["compile_ms"]) == ("a device", 4, 1234.0)
    assert record["prepare_ms"] == 56.0
    assert record["ms"] == pytest.approx(8.0)
    assert [entry["name"] for entry in record["passes"]] == ["raster", "march"]
    assert sum(entry["ms"] for entry in record["passes"]) == pytest.approx(record["ms"])
