"""What a comparison of two profiles marks, and what it refuses to compare."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from iprt.device.profile import Profile
from iprt.errors import FormatError, IprtError
from iprt.geometry.camera import View
from iprt.measure.changes import (
    FRAME,
    WALL,
    changed_settings,
    changes,
    require_comparable,
)
from iprt.measure.cost_report import CostReport, read_report
from iprt.settings.model import Settings
from tests.measure.test_cost import device_with
from tests.profiles import frame

FRAMES = 48


def report(
    names: Sequence[str],
    rng: np.random.Generator,
    *,
    slower: float = 1.0,
    settings: Settings | None = None,
    frames: int = FRAMES,
) -> CostReport:
    """Passes of 10 ms with noise of 5%, the first of them `slower`."""
    profile = Profile()
    for _ in range(frames):
        noise = 10.0 * (1.0 + 0.05 * rng.normal(size=len(names)))
        noise[0] *= slower
        frame(profile, dict(zip(names, noise, strict=True)))
    return CostReport.of(
        device_with(profile),
        scene="room",
        view=View(40, 30),
        settings=settings or Settings(),
        prepare_ms=0.0,
        walls=[20.0] * frames,
    )


def marked(before: CostReport, after: CostReport) -> list[tuple[str, str]]:
    return [(c.name, c.part) for c in changes(before, after) if c.beyond_noise]


@pytest.mark.thorough
def test_noise_alone_is_hardly_ever_marked() -> None:
    """In 5% of comparisons of all rows together, or less."""
    rng = np.random.default_rng(4)
    names = [f"pass {i}" for i in range(12)]
    alarms = sum(bool(marked(report(names, rng), report(names, rng))) for _ in range(30))
    assert alarms <= 5  # of 1.5 on average, no more in 99.5%


def test_what_changed_is_marked_and_nothing_else() -> None:
    rng = np.random.default_rng(4)
    names = ["march", "blend", "mask"]
    before, after = report(names, rng), report(names, rng, slower=1.2)
    assert marked(before, after) == [(FRAME, ""), ("march", ""), ("march", "march")]
    assert marked(after, before) == [(FRAME, ""), ("march", ""), ("march", "march")]
    wall, _, march, *_ = changes(before, after)
    assert (wall.name, wall.difference_ms, wall.before_ms) == (WALL, 0.0, 20.0)
    assert march.difference_ms == pytest.approx(2.0, abs=0.4)
    assert march.noise_ms is not None
    assert 0.1 < march.noise_ms < 1.5


def test_what_one_of_them_lacks_is_marked() -> None:
    rng = np.random.default_rng(4)
    before, after = report(["march", "old"], rng), report(["march", "new"], rng)
    rows = {c.name: c for c in changes(before, after) if not c.part}
    assert (rows["new"].before_ms, rows["old"].after_ms) == (None, None)
    assert rows["new"].beyond_noise
    assert rows["old"].difference_ms == pytest.approx(-10.0, abs=1.0)


def test_of_few_frames_nothing_is_said() -> None:
    rng = np.random.default_rng(4)
    before, after = report(["march"], rng), report(["march"], rng, slower=3.0, frames=3)
    rows = changes(before, after)
    assert all(row.noise_ms is None and not row.beyond_noise for row in rows)


def test_settings_that_differ_are_named() -> None:
    rng = np.random.default_rng(4)
    before = report(["march"], rng)
    after = report(["march"], rng, settings=Settings.model_validate({"trace": {"rays": 7}}))
    assert changed_settings(before, before) == []
    was = Settings().trace.rays
    assert changed_settings(before, after) == [f"trace.rays = 7, was {was}"]


@pytest.mark.parametrize(
    ("other", "says"),
    [
        ({"scene": "hall"}, "scene room, not hall"),
        ({"device": "a GPU"}, "device a device, not a GPU"),
        ({"view": View(40, 31)}, "height 30, not 31"),
        ({"view": View(40, 30, yaw_deg=2.0)}, "yaw_deg 0.0, not 2.0"),
    ],
)
def test_other_pictures_are_refused(other: dict[str, object], says: str) -> None:
    before = report(["march"], np.random.default_rng(0), frames=1)
    same = {"scene": "room", "device": "a device", "view": View(40, 30)}
    require_comparable(before, **same)  # type: ignore[arg-type]
    with pytest.raises(IprtError, match=says):
        require_comparable(before, **{**same, **other})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "Invalid JSON"),
        ("[1]", "expected the output of"),
        ("[" * 10_000, "Invalid JSON: recursion limit"),
        ('{"schema": 99}', "scene: Field required"),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "old.json"
    file.write_text(text)
    with pytest.raises(FormatError, match=says) as caught:
        read_report(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"old\.json: cannot be read: No such file"):
        read_report(tmp_path / "old.json")
