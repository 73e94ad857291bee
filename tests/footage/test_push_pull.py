"""Push and pull: what is known stays, and what is not is between it."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.footage.push_pull import push_pull

RNG = np.random.default_rng(7)


@pytest.mark.parametrize("blended", [False, True])
@pytest.mark.parametrize("shape", [(16, 32), (13, 26), (1, 2)])
def test_known_values_stay_and_others_lie_between(shape: tuple[int, int], blended: bool) -> None:
    values = RNG.uniform(1.0, 3.0, (*shape, 2))
    known = RNG.random(shape) < 0.2
    known[0, 0] = True
    weight = known.astype(np.float64)
    found = push_pull(values * weight[..., None], weight, blended=blended)
    np.testing.assert_array_equal(found[known], values[known])
    low, high = values[known].min(axis=0), values[known].max(axis=0)
    assert (found >= low - 1e-12).all()
    assert (found <= high + 1e-12).all()


def test_weights_below_one_count_for_less_if_blended() -> None:
    """A faint cell among sure ones goes to them; without blending it stays."""
    values, weight = np.ones((8, 16, 1)), np.ones((8, 16))
    values[4, 8], weight[4, 8] = 5.0, 0.25
    sums = values * weight[..., None]
    assert push_pull(sums, weight)[4, 8] == 5.0
    assert 1.5 < push_pull(sums, weight, blended=True)[4, 8] < 3.0


def test_cells_that_grow_in_width_keep_to_their_rows() -> None:
    """Rows of one value each, of which little is known."""
    value = np.arange(16.0)
    weight = np.zeros((16, 32))
    weight[np.arange(16), RNG.integers(32, size=16)] = 1.0
    sums = (weight * value[:, None])[..., None]
    rows = push_pull(sums, weight, wide_levels=5)
    np.testing.assert_allclose(rows[..., 0], np.repeat(value[:, None], 32, axis=1))
    assert np.abs(push_pull(sums, weight)[..., 0] - value[:, None]).max() > 0.5


def test_a_cell_of_which_a_quarter_is_known_counts_for_a_quarter() -> None:
    """One 1 among 0: the rest of its cell of 2 x 2 is mostly what is around that cell."""
    values, weight = np.zeros((16, 32, 1)), np.ones((16, 32))
    weight[4:6, 8:10] = 0.0
    values[4, 8], weight[4, 8] = 1.0, 1.0
    sums = values * weight[..., None]
    # Of the bilinear weights of the nine cells around, 9/16 are its own.
    assert push_pull(sums, weight)[5, 9, 0] == pytest.approx(9 / 16)
    coarser = push_pull(sums, weight, blended=True)[5, 9, 0] - 9 / 64
    assert 0.0 < coarser < 0.05
