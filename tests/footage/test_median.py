"""Exact medians of large pictures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.median import SMALL, median_of_smallest

Values = NDArray[np.float32]
SIZE = 4 * SMALL + 3


def wavy(rng: np.random.Generator) -> Values:
    """As a picture has it, with a period that a sample may share."""
    return (2.0 + np.sin(np.arange(SIZE) * 2.0 * np.pi / 32) + rng.random(SIZE)).astype(np.float32)


def skewed(rng: np.random.Generator) -> Values:
    return rng.gamma(0.2, 3.0, SIZE).astype(np.float32)


def tied(rng: np.random.Generator) -> Values:
    return np.round(rng.random(SIZE), 1).astype(np.float32)


def constant(_: np.random.Generator) -> Values:
    return np.full(SIZE, 3.0, np.float32)


def misleading(_: np.random.Generator) -> Values:
    """Every sample is 0, and little else."""
    values = np.ones(SIZE, np.float32)
    values[:: SIZE // (1 << 13)] = 0.0
    return values


def few(rng: np.random.Generator) -> Values:
    return rng.random(11).astype(np.float32)


@pytest.mark.parametrize("made", [wavy, skewed, tied, constant, misleading, few])
@pytest.mark.parametrize("empty", [0, 1, 4, 0.3])
def test_is_the_median_of_what_is_finite(
    made: Callable[[np.random.Generator], Values], empty: float
) -> None:
    rng = np.random.default_rng(0)
    values = made(rng)
    count = int(empty * values.size) if empty < 1 else int(empty)
    values[rng.permutation(values.size)[:count]] = np.inf
    finite = values[np.isfinite(values)]
    found = median_of_smallest(values, finite.size)
    assert found == pytest.approx(float(np.median(finite.astype(np.float64))), rel=1e-7)
