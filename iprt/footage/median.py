"""Exact medians of whole pictures, without sorting them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SMALL = 1 << 16
"""Number of values up to which they are partitioned directly."""
SAMPLES = 1 << 13
"""Number of values in the sample that brackets the median."""
MARGIN = 0.02
"""Half width of the bracket, in quantiles of the sample."""


def median_of_smallest(values: NDArray[np.float32], count: int) -> float:
    """Return the median of the `count` smallest values, equal to that from `np.median`.

    Parameters
    ----------
    values : float32, of any shape
        None of them is NaN.
    count : int
        At least 1.
    """
    values = values.ravel()
    ranks = (count - 1) // 2, count // 2
    if values.size > SMALL:
        share = 0.5 * count / values.size
        sample = np.sort(values[:: values.size // SAMPLES])
        low, high = (
            sample[int(np.clip(part * sample.size, 0, sample.size - 1))]
            for part in (share - MARGIN, share + MARGIN)
        )
        # The median is exact if it lies within the bracket, and is found among few values.
        below = int(np.count_nonzero(values < low))
        among = values[(values >= low) & (values <= high)]
        if below <= ranks[0] and ranks[1] < below + among.size:
            values, ranks = among, (ranks[0] - below, ranks[1] - below)
            if low == high:
                return float(low)
    middle = np.partition(values, ranks)
    return float(0.5 * (middle[ranks[0]] + middle[ranks[1]]))
