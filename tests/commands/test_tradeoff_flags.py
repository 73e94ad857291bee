"""`iprt render --time-per-frame` and `--ssim`: which settings they choose, and what they say."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from iprt.commands.setting_flags import SettingFlags
from iprt.errors import IprtError
from iprt.measure.tradeoff import shipped
from iprt.measure.tradeoff_cache import TimedDevice, keep
from iprt.settings.ladder import LADDER
from iprt.settings.model import Settings
from iprt.settings.overrides import changed
from tests.commands.conftest import FakeFilm
from tests.measure.tables import made_table

TIMED = TimedDevice("a device (a platform)", "1.0")
Render = Callable[..., list[str]]


@pytest.fixture
def rendered(
    command: Callable[..., int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> Render:
    """Render on a device that has a table of its own; the lines that were logged."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(TimedDevice, "of", lambda device: TIMED)
    keep(made_table(), TIMED.file)

    def run(**given: Any) -> list[str]:
        caplog.clear()
        with caplog.at_level(logging.INFO, "iprt.render"):
            assert command(output=tmp_path / "a.exr", **given) == 0
        return [record.getMessage() for record in caplog.records if record.name == "iprt.render"]

    return run


def settings_used() -> Settings:
    used: Settings = FakeFilm.calls[-1][-1]
    return used


def entry(name: str, **other: object) -> Settings:
    return changed(Settings(fading=0.0), {**LADDER[name], **other})


@pytest.mark.parametrize(("place", "name"), list(enumerate(LADDER)))
def test_the_most_accurate_entry_that_is_quick_enough(
    place: int, name: str, rendered: Render
) -> None:
    seconds = made_table().entries[place].seconds_of(512).mean
    (line,) = rendered(time_per_frame=1.01 * seconds)
    assert settings_used() == entry(name)
    assert line.startswith(f"--time-per-frame {1.01 * seconds:g}: '{name}' (")
    assert f"about {seconds:.2g} (" in line
    assert "an estimate from the views of room" in line


@pytest.mark.parametrize(("place", "name"), list(enumerate(LADDER)))
@pytest.mark.parametrize("accumulate", [1, 16])
def test_the_quickest_entry_that_is_accurate_enough(
    place: int, name: str, accumulate: int, rendered: Render
) -> None:
    table = made_table()
    ssim = table.ssim(table.entries[place], accumulate)
    (line,) = rendered(ssim=round(ssim.mean - 0.001, 4), accumulate=accumulate)
    assert settings_used() == entry(name)
    assert f"SSIM {ssim.mean:.3g} ({ssim.low:.3g} to {ssim.high:.3g})" in line


@pytest.mark.parametrize(
    ("goal", "name"), [({"time_per_frame": 1e-4}, "light 8"), ({"ssim": 0.99999}, "accurate")]
)
def test_what_no_entry_grants_comes_as_near_as_it_can(
    goal: dict[str, float], name: str, rendered: Render
) -> None:
    (line,) = rendered(**goal)
    assert settings_used() == entry(name)
    assert "no entry is estimated to reach it; the nearest is" in line
    assert f"'{name}'" in line


def test_what_is_set_wins_over_the_entry(rendered: Render, tmp_path: Path) -> None:
    file = tmp_path / "my.toml"
    file.write_text("[trace]\nrays = 7\nobject_rays = 9\n")
    lines = rendered(
        ssim=0.5, setting_flags=SettingFlags(settings=file, set=("trace.rays=3",)), seed=5
    )
    quickest = next(iter(LADDER))
    assert settings_used() == entry(
        quickest, **{"trace.rays": 3, "trace.object_rays": 9, "seed": 5}
    )
    assert "trace.rays, trace.object_rays: changed from the entry's" in lines[-1]
    assert len(lines) == 2


def test_times_of_another_device_are_called_so(rendered: Render) -> None:
    TIMED.file.unlink()
    _, line = rendered(ssim=0.5)
    assert shipped().device in line
    assert "iprt calibrate" in line


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"time_per_frame": 0.1, "ssim": 0.9}, "--time-per-frame 0.1 and --ssim 0.9: give one"),
        ({"time_per_frame": 0.0}, "--time-per-frame 0: expected seconds above 0"),
        ({"time_per_frame": float("nan")}, "--time-per-frame nan: expected"),
        ({"ssim": 1.5}, "--ssim 1.5: expected above 0 and at most 1"),
        ({"ssim": 0.0}, "--ssim 0: expected"),
        (
            {"ssim": 0.9, "setting_flags": SettingFlags(quality="draft")},
            "--quality draft and --ssim 0.9: give one of them",
        ),
        ({"ssim": 0.9, "method": "ibl"}, "--ssim 0.9: is for the method iprt, not for ibl"),
    ],
)
def test_wishes_that_mean_nothing(
    given: dict[str, Any], told: str, command: Callable[..., int], tmp_path: Path
) -> None:
    with pytest.raises(IprtError) as error:
        command(output=tmp_path / "a.exr", **given)
    assert told in str(error.value)
    assert FakeFilm.calls == []
