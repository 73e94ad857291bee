"""`iprt farm plan`, and the table of `docs/farm_scale.py`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from docs import farm_scale
from iprt.farm.plan import HALF, fade_bytes, movie_bytes

PLAN = ("farm", "plan", "--seconds-per-frame", "2", "--markdown")


def test_a_film_is_forecast(clip: Path, tmp_path: Path, printed: Callable[..., str]) -> None:
    """The clip has 20 frames: chunks of 16 and 4, and warm-ups of 8."""
    order = (clip, "-o", tmp_path / "out" / "a.mp4", "--accumulate", "2", "--chunk", "16")
    exact = ("--deaths-per-hour", "0", "--start-seconds", "60", "--workers", "1,3")
    _, _, one, three = printed(*PLAN, *order, *exact).splitlines()
    assert one.startswith("| 1 | 16 | ")
    assert three.startswith("| 3 | 16 | ")
    assert "| workers |" in one
    assert "| chunk |" in three
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["a.mp4", "a.%03d.png", "a.%03d.exr"])
def test_a_slow_storage_limits_any_film(
    name: str, clip: Path, tmp_path: Path, printed: Callable[..., str]
) -> None:
    order = (clip, "-o", tmp_path / name, "--storage", "0.0000001", "--workers", "2")
    assert printed(*PLAN, *order).count("| storage |") == 2


def test_bytes_are_counted_as_files_have_them() -> None:
    from iprt.output.encode import planes
    from tests.clips import clip_color

    color = clip_color(0, 64)
    assert movie_bytes(64 * 32, 8) == 2 * planes(color, 1.0, "h264").nbytes
    assert movie_bytes(64 * 32, 10) == 2 * planes(color, 1.0, "hevc").nbytes
    assert fade_bytes(64 * 32, 8, HALF) == 4 * 4 * color.astype("f2").nbytes


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--workers", "0"), "--workers 0: expected numbers from 1 to 100000, such as 1,10,100"),
        (("--workers", "1,x"), "--workers 1,x: expected"),
        (("--workers", "1000000"), "--workers 1000000: expected"),
        (("--seconds-per-frame", "0"), "--seconds-per-frame 0: expected a number above 0"),
        (("--storage", "inf"), "--storage inf: expected a number above 0"),
        (("--deaths-per-hour", "-1"), "--deaths-per-hour -1: expected 0 or more"),
        (("--start-seconds", "nan"), "--start-seconds nan: expected 0 or more"),
        (("--output", "a.exr"), "a.exr: is a still picture"),
    ],
)
def test_bad_input_is_told(
    words: tuple[str, ...], told: str, clip: Path, fails: Callable[..., str]
) -> None:
    assert told in fails(*PLAN, clip, "-o", "a.mp4", *words)


def test_the_page_has_the_forecast() -> None:
    page = farm_scale.PAGE.read_text(encoding="utf-8")
    shown = page.partition(farm_scale.START)[2].partition(farm_scale.END)[0].strip()
    assert shown == farm_scale.page_part(), "run python docs/farm_scale.py"
