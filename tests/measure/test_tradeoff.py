"""What time buys: estimates, choices, and tables that cannot be believed."""

from __future__ import annotations

import logging
import math
import re
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from iprt.errors import FormatError
from iprt.measure.pareto import pareto_front
from iprt.measure.tradeoff import Entry, Range, Tradeoff, shipped
from iprt.measure.tradeoff_cache import TimedDevice, keep, tradeoff_for
from iprt.measure.tradeoff_report import tradeoff_grid
from iprt.settings.ladder import BALANCED, KEYS, LADDER, entry_assignments
from iprt.settings.model import Settings
from iprt.settings.overrides import changed, resolved
from iprt.settings.presets import CONVERGED, PRESETS, Quality
from tests.measure.tables import STEP, made_table, ratio_of

TIMED = TimedDevice("a device (a platform)", "1.0")


def named(table: Tradeoff, name: str) -> Entry:
    return next(entry for entry in table.entries if entry.name == name)


# The ladder --------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", [name for name in PRESETS if name not in CONVERGED])
@pytest.mark.parametrize("name", LADDER)
def test_an_entry_replaces_all_that_a_preset_sets(name: str, preset: Quality) -> None:
    chosen = resolved(preset, entry_assignments(name))
    assert chosen == changed(Settings(), LADDER[name])
    assert {item.key for item in entry_assignments(name)} == set(KEYS)


@pytest.mark.parametrize("name", [name for name in PRESETS if name not in CONVERGED])
def test_presets_are_entries(name: Quality) -> None:
    """All but those whose time is not that of a frame."""
    assert LADDER[name] == PRESETS[name]


# Estimates ---------------------------------------------------------------------------------------


def test_seconds_are_a_line_through_the_pixels_of_each_view() -> None:
    entry = named(made_table(), BALANCED)
    assert entry.seconds_of(100_000) == Range(pytest.approx(0.015), 0.01, pytest.approx(0.02))
    assert entry.seconds_of(0) == Range(pytest.approx(0.0075), 0.005, 0.01)


@pytest.mark.parametrize(
    ("frames", "in_a"), [(1, 0.85), (2, 0.865), (4, 0.88), (8, 0.89), (16, 0.9), (999, 0.9)]
)
def test_ssim_is_linear_in_the_logarithm_of_the_frames(frames: int, in_a: float) -> None:
    table = made_table()
    found = table.ssim(named(table, BALANCED), frames)
    assert found.high == pytest.approx(in_a)
    assert found.low == pytest.approx(in_a - 0.05)
    assert found.mean == pytest.approx(in_a - 0.025)


def test_estimates_in_words() -> None:
    assert Range(0.0784, 0.071, 0.0849).text(2) == "0.078 (0.071 to 0.085)"
    assert Range(0.5, 0.5, 0.5).text(2) == "0.5"


# Choices -----------------------------------------------------------------------------------------

tables = st.lists(
    st.tuples(st.floats(0.001, 1.0), st.floats(0.5, 1.0)),
    min_size=len(LADDER),
    max_size=len(LADDER),
).map(
    lambda figures: made_table(
        entries=[
            Entry(name=name, ratio=[1.0] * 3, seconds={"a": [s, 0.0]}, ssim={"a": [q] * 3})
            for name, (s, q) in zip(LADDER, figures, strict=True)
        ]
    )
)


@given(table=tables, wanted=st.floats(0.001, 1.0))
def test_no_other_entry_is_more_accurate_in_the_time(table: Tradeoff, wanted: float) -> None:
    chosen, granted = table.within(wanted, 1000, 4)
    times = {entry.name: entry.seconds_of(1000).mean for entry in table.entries}
    assert granted == any(time <= wanted for time in times.values())
    if not granted:
        assert times[chosen.name] == min(times.values())
        return
    assert times[chosen.name] <= wanted
    for entry in table.entries:
        if times[entry.name] <= wanted:
            assert entry.ssim["a"][0] <= chosen.ssim["a"][0]


@given(table=tables, wanted=st.floats(0.5, 1.0))
def test_no_other_entry_reaches_the_ssim_more_quickly(table: Tradeoff, wanted: float) -> None:
    chosen, granted = table.reaching(wanted, 1000, 4)
    best = max(table.ssim(entry, 4).mean for entry in table.entries)
    assert granted == (best >= wanted)
    if not granted:
        assert table.ssim(chosen, 4).mean == best
        return
    assert table.ssim(chosen, 4).mean >= wanted
    for entry in table.entries:
        if table.ssim(entry, 4).mean >= wanted:
            assert entry.seconds_of(1000).mean >= chosen.seconds_of(1000).mean


def test_more_pixels_leave_a_quicker_entry() -> None:
    table = made_table()
    assert table.within(0.0151, 100_000, 4)[0].name == BALANCED
    assert ratio_of(table, table.within(0.0151, 300_000, 4)[0].name) == pytest.approx(STEP**2)


# Files -------------------------------------------------------------------------------------------


def test_a_table_survives_its_file(tmp_path: Path) -> None:
    table = made_table()
    keep(table, tmp_path / "new" / "a.toml")
    assert Tradeoff.read(tmp_path / "new" / "a.toml") == table


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("format = 1", "format = 2", "format"),
        ("[0.85, 0.88, 0.9]", "[0.85, 0.88]", "expected an SSIM for each of frames"),
        ("[0.85, 0.88", "[0.85, 1.88", "entries.4.ssim.a.1"),
        ("[0.85, 0.88", "[0.85, nan", "entries.4.ssim.a.1"),
        ("[1, 4, 16]", "[1, 16, 4]", "rising"),
        ("[1, 4, 16]", "[0, 4, 16]", "frames.0"),
        ("seconds]\na = [0.01, ", "seconds]\na = [-0.01, ", "entries.4.seconds.a.0"),
        ('"balanced"', '"other"', "differ from this version's"),
        ("entries", "entry", "entries"),
        ('"room"', "7", "scene"),
        ("=", "", "not valid TOML"),
    ],
)
def test_what_is_no_table_is_refused_in_one_line(
    old: str, new: str, told: str, tmp_path: Path
) -> None:
    text = made_table().text("A table.")
    assert old in text
    file = tmp_path / "a.toml"
    file.write_text(text.replace(old, new))
    with pytest.raises(FormatError, match=re.escape(told)) as error:
        Tradeoff.read(file)
    assert str(error.value).startswith(str(file))
    assert "\n" not in str(error.value)


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the device's own table is kept; there is none."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert TIMED.file.is_relative_to(tmp_path)
    return TIMED.file


def test_without_an_own_table_it_is_the_shipped_one(
    own: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert not own.exists()
    assert tradeoff_for(TIMED) is shipped()
    assert caplog.records == []


def test_the_own_table_is_that_of_the_device(own: Path) -> None:
    table = made_table()
    keep(table, own)
    assert tradeoff_for(TIMED) == table
    assert TIMED.made(table)
    assert tradeoff_for(TimedDevice("another (a platform)", "1.0")) is shipped()


@pytest.mark.parametrize("change", [{"driver": "0.9"}, {"version": "0.0.1"}, {"device": "renamed"}])
def test_an_outdated_table_is_ignored_with_one_line(
    change: dict[str, str], own: Path, caplog: pytest.LogCaptureFixture
) -> None:
    keep(made_table(**change), own)
    with caplog.at_level(logging.WARNING):
        assert tradeoff_for(TIMED) is shipped()
    (record,) = caplog.records
    assert "iprt calibrate" in record.getMessage()


@pytest.mark.parametrize("damage", ["empty", "half", "noise", "folder"])
def test_a_damaged_table_is_ignored_with_one_line(
    damage: str, own: Path, caplog: pytest.LogCaptureFixture
) -> None:
    keep(made_table(), own)
    whole = own.read_bytes()
    own.unlink()
    if damage == "folder":
        own.mkdir()
    else:
        half = whole[: len(whole) // 2]
        own.write_bytes({"empty": b"", "half": half, "noise": bytes(range(256))}[damage])
    with caplog.at_level(logging.WARNING):
        assert tradeoff_for(TIMED) is shipped()
    (record,) = caplog.records
    assert "\n" not in record.getMessage()
    assert str(own) in record.getMessage()
    assert "iprt calibrate" in record.getMessage()


# The shipped table -------------------------------------------------------------------------------


def test_every_shipped_entry_is_on_the_front() -> None:
    """Of time and SSIM, the mean over views and numbers of frames; and each gains something."""
    rows = tradeoff_grid(shipped()).rows
    assert [row[0] for row in rows] == list(LADDER)
    assert all(row[-1] == "*" for row in rows)
    ratios = [entry.ratio[0] for entry in shipped().entries]
    assert ratios == sorted(ratios)
    for entry in shipped().entries:
        ratio, low, high = entry.ratio
        assert low <= ratio <= high
        assert entry.seconds.keys() == entry.ssim.keys() == {"table", "rug"}
        assert entry.seconds_of(2**18).mean == pytest.approx(
            ratio * named(shipped(), BALANCED).seconds_of(2**18).mean, rel=0.2
        )
        # More frames never cost accuracy worth speaking of.
        for line in entry.ssim.values():
            assert all(b > a - 0.002 for a, b in pairwise(line))


def test_the_table_in_print() -> None:
    grid = tradeoff_grid(made_table())
    row = next(row for row in grid.rows if row[0] == BALANCED)
    assert "balanced: the defaults." in grid.notes
    assert row[1] == "1.00 (0.90 to 1.10)"
    seconds = named(made_table(), BALANCED).seconds_of(512**2)
    assert row[2] == f"{1e3 * seconds.mean:.1f} ± {500.0 * (seconds.high - seconds.low):.1f}"
    longer = (0.01 + 4e-7 * 512**2) / (0.01 + 1e-7 * 512**2)
    assert row[3] == f"{longer:.1f}"
    assert row[5] == "0.855 ± 0.025"
    marks = pareto_front([(math.exp(i), -i) for i in range(len(grid.rows))])
    assert [row[-1] == "*" for row in grid.rows] == marks
