"""Gaussian means over some of a panorama's cells: across the seam, and of what is kept alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from iprt.footage.found_gloss.cell_means import MeansAround

ROWS = 16


@pytest.mark.parametrize("deviation", [0.3, 1.5, 4.0])
def test_means_are_those_of_filters_over_the_whole_panorama(deviation: float) -> None:
    rng = np.random.default_rng(0)
    on = np.flatnonzero(rng.random(2 * ROWS**2) < 0.4)
    kept = rng.random(len(on)) < 0.7
    parts = rng.normal(size=(2, len(on), 3))
    whole = np.zeros((2, ROWS, 2 * ROWS, 3))
    count = np.zeros((ROWS, 2 * ROWS, 1))
    whole.reshape(2, -1, 3)[:, on[kept]] = parts[:, kept]
    count.reshape(-1)[on[kept]] = 1.0
    mode = ("nearest", "wrap")
    sums = gaussian_filter(whole, deviation, axes=(1, 2), mode=mode)
    weight = np.maximum(gaussian_filter(count, deviation, axes=(0, 1), mode=mode), 1e-9)
    wanted = (sums / weight).reshape(2, -1, 3)[:, on]
    found = MeansAround(ROWS, on)(parts, kept, deviation)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)


def test_what_is_even_stays() -> None:
    """Though only some cells count, and none of them lies beside another one of its row."""
    on = np.arange(0, 2 * ROWS**2, 2)
    kept = np.arange(len(on)) % 3 > 0
    even = np.full((1, len(on), 1), 7.0)
    np.testing.assert_allclose(MeansAround(ROWS, on)(even, kept, 2.0), even)


def test_nothing_has_no_means() -> None:
    on = np.arange(5)
    kept = np.ones(5, bool)
    assert MeansAround(ROWS, on)(np.zeros((0, 5, 3)), kept, 2.0).shape == (0, 5, 3)
    assert not MeansAround(ROWS, on)(np.zeros((2, 5, 3)), kept, 2.0).any()
