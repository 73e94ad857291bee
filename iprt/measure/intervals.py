"""Means with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, stdev

CONFIDENCE = 0.95


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
