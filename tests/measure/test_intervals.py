"""Confidence intervals against SciPy's, and by how often they hold the mean."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from iprt.measure.intervals import Estimate, Ratio


@pytest.mark.parametrize("count", [2, 3, 10])
def test_interval_is_students(count: int) -> None:
    values = np.random.default_rng(count).normal(0.9, 0.01, count)
    found = Estimate.of(list(values))
    low, high = stats.t.interval(0.95, count - 1, values.mean(), stats.sem(values))
    assert found.half is not None
    np.testing.assert_allclose([found.mean - found.half, found.mean + found.half], [low, high])


def test_intervals_hold_the_mean_as_often_as_they_say() -> None:
    rng = np.random.default_rng(1)
    found = [Estimate.of(list(rng.normal(5.0, 1.0, 3))) for _ in range(1000)]
    held = np.mean([abs(e.mean - 5.0) <= e.half for e in found if e.half is not None])
    assert 0.93 < held < 0.97


def test_one_value_has_no_interval() -> None:
    assert Estimate.of([0.25]) == Estimate(0.25, None)
    assert Estimate.of([0.25]).text() == "0.2500"
    assert Estimate(0.5, 0.01234).text(3) == "0.500 ± 0.012"


def test_a_ratio_of_paired_times_holds_while_the_machine_slows_down() -> None:
    rng = np.random.default_rng(0)
    slow = np.linspace(1.0, 4.0, 40)
    base, other = np.exp(0.05 * rng.normal(size=(2, 40))) * slow * [[2.0], [2.4]]
    other[7] *= 20.0  # one pair that something else disturbed
    ratio = Ratio.of(list(other), list(base))
    assert ratio.value == pytest.approx(1.2, rel=0.06)
    assert ratio.low is not None
    assert ratio.high is not None
    assert ratio.high - ratio.low < 0.15
    assert ratio.differs
    assert ratio.text() == f"{ratio.value:.2f} ({ratio.low:.2f} to {ratio.high:.2f})"


def test_an_interval_around_one_says_that_no_difference_was_seen() -> None:
    rng = np.random.default_rng(1)
    same = [Ratio.of(*np.exp(0.1 * rng.normal(size=(2, 32))).tolist()) for _ in range(400)]
    # 5% of true intervals miss what they are of.
    assert 0.02 < np.mean([ratio.differs for ratio in same]) < 0.09
    assert next(r for r in same if not r.differs).text().startswith("no difference seen (0.")
    assert Ratio.of([3.0], [2.0]) == Ratio(1.5, None, None)
    assert not Ratio.of([3.0], [2.0]).differs
