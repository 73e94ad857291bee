"""The forecast of farms: where the time is known by a formula, it is that."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import pytest

from iprt.farm.model import SEEDS, Farm, FilmCost, best_forecast, forecast, limits
from iprt.farm.plan import duration, grid

FILM = FilmCost(1200, 8, 0.5)
"""With a chunk of 120: ten tasks of 64 s."""


def test_one_worker_takes_the_sum() -> None:
    farm = Farm(1, start_s=5.0, task_s=0.25, storage=1e6)
    film = replace(FILM, frame_bytes=1e4, chunk_bytes=1e5, join_s=3.0)
    found = forecast(film, farm, 120)
    rendered = 1200 + 10 * 8
    storage = (rendered * 1e4 + 10 * 1e5) / 1e6
    assert found.seconds == pytest.approx(rendered * 0.5 + 10 * (5.0 + 0.25) + storage + 3.0)
    assert found.limits["storage"] == pytest.approx(storage)
    assert (found.limit, found.repeats) == ("workers", 0.0)
    # The last chunk is shorter.
    assert forecast(FILM, Farm(1), 700).seconds == pytest.approx((700 + 8 + 500 + 8) * 0.5)


def test_any_number_of_workers_takes_the_longest_chunk_and_the_scheduler() -> None:
    farm = Farm(10**4, start_s=5.0, task_s=0.25)
    found = forecast(FILM, farm, 120)
    assert found.seconds == pytest.approx(10 * 0.25 + 5.0 + 128 * 0.5)
    assert found.limit == "chunk"
    slow = forecast(FILM, replace(farm, task_s=60.0), 120)
    assert slow.seconds == pytest.approx(10 * 60.0 + 5.0 + 128 * 0.5)
    assert slow.limit == "scheduler"


def test_equal_workers_go_in_rounds() -> None:
    assert forecast(FILM, Farm(5), 120).seconds == pytest.approx(2 * 64.0)
    assert forecast(FILM, Farm(4), 120).seconds == pytest.approx(3 * 64.0)


@pytest.mark.parametrize("workers", [20, 1000])
def test_storage_takes_bytes_over_its_rate(workers: int) -> None:
    film = replace(FILM, frames=108_000, frame_bytes=45e6, chunk_bytes=1e9)
    farm = Farm(workers, storage=1e8)
    found = forecast(film, farm, 120)
    bound = (108_000 * (1 + 8 / 120) * 45e6 + 900 * 1e9) / 1e8
    assert found.limits["storage"] == pytest.approx(bound)
    assert found.limit == "storage"
    assert bound <= found.seconds == pytest.approx(bound, rel=0.01)


@pytest.mark.parametrize("deaths", [0.5, 5.0, 30.0])
def test_repeats_are_as_the_exponential_law_says(deaths: float) -> None:
    """A task of t seconds with death rate r takes (exp(rt) - 1) / r on average, with no wait."""
    film, task_s = FilmCost(40_000, 8, 0.5), 64.0 + 5.0
    rate, tasks = deaths / 3600.0, math.ceil(40_000 / 120)
    found = forecast(film, Farm(1, start_s=5.0, deaths=deaths), 120)
    mean = math.expm1(rate * task_s) / rate
    variance = (math.exp(2 * rate * task_s) - 2 * rate * task_s * math.exp(rate * task_s) - 1) / (
        rate**2
    )
    error = math.sqrt(variance * tasks / len(SEEDS))
    assert abs(found.seconds - tasks * mean) < 4 * error + task_s
    repeats = tasks * math.expm1(rate * task_s)
    assert abs(found.repeats - repeats) < 4 * math.sqrt(repeats / len(SEEDS)) * math.exp(
        rate * task_s
    )


def test_no_one_dies_without_a_rate_and_all_wait_for_the_lost() -> None:
    dying = Farm(10, deaths=20.0)
    assert forecast(FILM, replace(dying, deaths=0.0), 120).seconds == pytest.approx(64.0)
    quick, late = (forecast(FILM, replace(dying, lost_s=s), 120) for s in (0.0, 500.0))
    assert quick.repeats > 0
    assert late.seconds >= quick.seconds + 500.0
    assert quick.seconds > 64.0


def test_stragglers_cost_the_most_at_the_end() -> None:
    """The workers' mean speed does not depend on the spread."""
    film = replace(FILM, frames=120_000)
    equal, mixed = (forecast(film, Farm(50, spread=s), 120) for s in (0.0, 0.3))
    assert equal.seconds < mixed.seconds < 1.1 * equal.seconds
    one_each = [forecast(film, Farm(1000, spread=s), 120).seconds for s in (0.0, 0.3)]
    assert one_each[1] > 1.8 * one_each[0]


def test_no_forecast_is_below_what_the_parts_allow() -> None:
    film = replace(FILM, frame_bytes=1e6, chunk_bytes=1e7, join_s=2.0)
    for workers in (1, 3, 10, 100):
        for chunk in (8, 60, 120, 2000):
            farm = Farm(workers, 5.0, 0.1, 1e8, deaths=1.0, lost_s=10.0)
            assert forecast(film, farm, chunk).seconds >= max(limits(film, farm, chunk).values())


def test_the_best_chunk_is_long_for_few_and_short_for_many() -> None:
    film, chunks = replace(FILM, frames=10_800), (16, 60, 120, 240, 600, 1800)
    farm = Farm(1, start_s=5.0, task_s=0.01)
    best = {n: best_forecast(film, replace(farm, workers=n), chunks) for n in (1, 10, 1000)}
    assert best[1].chunk == 1800
    assert best[1].chunk > best[10].chunk > best[1000].chunk == 16
    for n, found in best.items():
        times = [forecast(film, replace(farm, workers=n), chunk).seconds for chunk in chunks]
        assert found.seconds <= 1.03 * min(times)


def test_a_thousand_workers_are_forecast_in_seconds() -> None:
    film = FilmCost(108_000, 8, 0.5, 45e6, 1e9, 60.0)
    begun = time.process_time()
    shown = grid(film, Farm(1, 5.0, 0.01, 1e9, 0.1, 0.01, 120.0), (1, 10, 100, 1000), 120)
    assert time.process_time() - begun < 20.0
    assert [row[0] for row in shown.rows] == ["1", "10", "100", "1,000"]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.4, "0 s"),
        (59.6, "1 min 0 s"),
        (245.0, "4 min 5 s"),
        (12_000.0, "3 h 20 min"),
        (190_900.0, "2 d 5 h"),
    ],
)
def test_durations_have_two_units(seconds: float, text: str) -> None:
    assert duration(seconds) == text
