"""Means and ratios with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, stdev

import numpy as np

CONFIDENCE = 0.95
BLOCKS = 8
"""Runs of pairs that a ratio is the mean of."""


@dataclass(frozen=True)
class Estimate:
    """A mean and the half width of its confidence interval; None of one value."""

    mean: float
    half: float | None

    @classmethod
    def of(cls, values: Sequence[float]) -> Estimate:
        """From independent values, at least one: mean ± t s/√n, with Student's t of n - 1."""
        if len(values) == 1:
            return cls(values[0], None)
        from scipy.stats import t

        quantile = float(t.ppf(0.5 + 0.5 * CONFIDENCE, len(values) - 1))
        return cls(fmean(values), quantile * stdev(values) / math.sqrt(len(values)))

    def text(self, digits: int = 4) -> str:
        """`0.9512 ± 0.0004`."""
        mean = f"{self.mean:.{digits}f}"
        return mean if self.half is None else f"{mean} ± {self.half:.{digits}f}"


@dataclass(frozen=True)
class Ratio:
    """A ratio of times, and its confidence interval; None where there is one pair only."""

    value: float
    low: float | None
    high: float | None

    @classmethod
    def of(cls, times: Sequence[float], base: Sequence[float]) -> Ratio:
        """From pairs of times, at least one, that were taken one after the other.

        The mean of the logarithms of their quotients, of `BLOCKS` runs of pairs where there are
        so many, each by its median: what disturbs one pair, or some in a row, counts once.
        """
        logarithms = np.log(np.divide(times, base))
        blocks = np.array_split(logarithms, min(BLOCKS, len(logarithms)))
        estimate = Estimate.of([float(np.median(block)) for block in blocks])
        if estimate.half is None:
            return cls(math.exp(estimate.mean), None, None)
        ends = (estimate.mean - estimate.half, estimate.mean + estimate.half)
        return cls(math.exp(estimate.mean), *map(math.exp, ends))

    @property
    def differs(self) -> bool:
        """1 is outside the interval."""
        return self.low is not None and self.high is not None and not self.low <= 1.0 <= self.high

    def text(self) -> str:
        """`0.82 (0.80 to 0.84)`, or that no difference was seen."""
        if self.low is None or self.high is None:
            return f"{self.value:.2f}"
        interval = f"({self.low:.2f} to {self.high:.2f})"
        return f"{self.value:.2f} {interval}" if self.differs else f"no difference seen {interval}"
