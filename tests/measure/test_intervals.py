"""Confidence intervals against SciPy's, and by how often they hold the mean."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from iprt.measure.intervals import Estimate


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
