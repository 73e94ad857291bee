"""Exact medians of whole pictures, without sorting them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SMALL = 1 << 16
"""Fewer values are sorted right away."""
SAMPLES = 1 << 13
"""Values that are sorted to find out about where the median lies."""
MARGIN = 0.02
"""It is expected between quantiles that are this far from it, of a sample."""


def median_of_smallest(values: NDArray[np.float32], count: int) -> float:
    """The median of the `count` smallest of some values, as `np.median` has it.

    Parameters
    ----------
    values : float32, of any shape
        None of them is NaN.
    count : int
        From 1 on.
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
        # Only if it lies between them; it is found among few, and exactly.
        below = int(np.count_nonzero(values < low))
        among = values[(values >= low) & (values <= high)]
        if below <= ranks[0] and ranks[1] < below + among.size:
            values, ranks = among, (ranks[0] - below, ranks[1] - below)
            if low == high:
                return float(low)
    middle = np.partition(values, ranks)
    return float(0.5 * (middle[ranks[0]] + middle[ranks[1]]))
