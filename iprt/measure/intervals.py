"""Means and ratios with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, stdev

import numpy as np

CONFIDENCE = 0.95
OVER_SEEDS = f"±: {CONFIDENCE:.0%} confidence over seeds."
BLOCKS = 8
"""Number of blocks of consecutive pairs that a ratio averages."""


@dataclass(frozen=True)
class Estimate:
    """A mean and the half width of its confidence interval, which is None for a single value."""

    mean: float
    half: float | None

    @classmethod
    def of(cls, values: Sequence[float]) -> Estimate:
        """Estimate from n independent values: mean ± t s/√n, Student's t with n - 1 degrees."""
        if len(values) == 1:
            return cls(values[0], None)
        from scipy.stats import t

        quantile = float(t.ppf(0.5 + 0.5 * CONFIDENCE, len(values) - 1))
        return cls(fmean(values), quantile * stdev(values) / math.sqrt(len(values)))

    def text(self, digits: int = 4) -> str:
        """Format the estimate, such as `0.9512 ± 0.0004`."""
        mean = f"{self.mean:.{digits}f}"
        return mean if self.half is None else f"{mean} ± {self.half:.{digits}f}"


@dataclass(frozen=True)
class Ratio:
    """A ratio of times and its confidence interval, which is None for a single pair."""

    value: float
    low: float | None
    high: float | None

    @classmethod
    def of(cls, times: Sequence[float], base: Sequence[float]) -> Ratio:
        """Estimate the ratio from at least one pair of consecutive measurements.

        The logarithms of the ratios are split into up to `BLOCKS` blocks of consecutive pairs. The
        estimate averages the blocks' medians, so that a disturbance of one or several pairs
        affects one block.
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
        """True if the interval excludes 1."""
        return self.low is not None and self.high is not None and not self.low <= 1.0 <= self.high

    def text(self) -> str:
        """Format the ratio, such as `0.82 (0.80 to 0.84)`, or say that no difference was seen."""
        if self.low is None or self.high is None:
            return f"{self.value:.2f}"
        interval = f"({self.low:.2f} to {self.high:.2f})"
        return f"{self.value:.2f} {interval}" if self.differs else f"no difference seen {interval}"
