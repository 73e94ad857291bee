"""Robust regression of the evidence of gloss."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.footage.found_gloss.regression import effective_blocks, least_squares, robust_weights

BLOCK = np.arange(600) // 30  # 20 blocks
ONE = np.ones(600)


@pytest.mark.parametrize("count", [1, 3, 20])
def test_blocks_count_by_their_information(count: int) -> None:
    """A regressor that varies in some blocks only is known from these alone."""
    rng = np.random.default_rng(0)
    x = np.where(count > BLOCK, rng.choice([-1.0, 1.0], 600), 0.0)[:, None]
    assert effective_blocks(x, 0, ONE, BLOCK) == pytest.approx(count, rel=1e-6)


def test_what_other_regressors_explain_is_no_information() -> None:
    rng = np.random.default_rng(1)
    shading = rng.normal(size=600)
    own = np.where(BLOCK == 4, rng.normal(size=600), 0.0)
    x = np.stack([3.0 * shading + own, shading], axis=-1)
    assert effective_blocks(x, 0, ONE, BLOCK) < 1.5
    assert effective_blocks(x[:, 1:], 0, ONE, BLOCK) > 15.0


def test_outliers_hardly_move_a_robust_fit() -> None:
    rng = np.random.default_rng(2)
    x = rng.normal(size=(600, 1))
    y = 0.7 * x[:, 0] + 0.05 * rng.normal(size=600)
    y[::20] += 5.0
    weight = ONE
    for _ in range(8):
        (found,), _ = least_squares(x, y, weight)
        weight = robust_weights([y - found * x[:, 0]])
    assert found == pytest.approx(0.7, abs=0.02)
    assert weight[::20].max() < 0.1
