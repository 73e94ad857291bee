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
        low, high = _bracket(values, count)
        # The median is exact if it lies within the bracket, and is found among few values.
        below = int(np.count_nonzero(values < low))
        among = values[(values >= low) & (values <= high)]
        if below <= ranks[0] and ranks[1] < below + among.size:
            values, ranks = among, (ranks[0] - below, ranks[1] - below)
            if low == high:
                return float(low)
    middle = np.partition(values, ranks)
    return float(0.5 * (middle[ranks[0]] + middle[ranks[1]]))


class MedianOfRows:
    """`median_of_smallest` of a picture of which a few rows change at a time.

    Parameters
    ----------
    height : int
        Number of rows.
    """

    def __init__(self, height: int) -> None:
        self._height = height
        self._low, self._high = np.float32(np.inf), np.float32(-np.inf)
        self._below = np.zeros(height, np.intp)
        self._among: list[NDArray[np.float32]] = []

    def of(self, values: NDArray[np.float32], rows: NDArray[np.intp], count: int) -> float | None:
        """Return the median; 0 without values, None if it takes all rows to find it.

        Parameters
        ----------
        values : (N, W) float32
            The rows that may have changed. None of them is NaN.
        rows : (N,) int
            Their indices; at first of all rows.
        count : int
            Number of the smallest values.
        """
        whole = len(rows) == self._height
        if not count:
            self._among = []
            return 0.0
        if whole:
            self._bracket(values, count)
        elif not self._among:
            return None
        inside = (values >= self._low) & (values <= self._high)
        self._below[rows] = np.count_nonzero(values < self._low, axis=1)
        ends = np.cumsum(np.count_nonzero(inside, axis=1))[:-1]
        for row, part in zip(rows, np.split(values[inside], ends), strict=True):
            self._among[row] = part
        among, below = np.concatenate(self._among), int(self._below.sum())
        first, second = (count - 1) // 2 - below, count // 2 - below
        if first < 0 or second >= among.size:
            return median_of_smallest(values, count) if whole else None
        middle = np.partition(among, (first, second))
        return float(0.5 * (middle[first] + middle[second]))

    def _bracket(self, values: NDArray[np.float32], count: int) -> None:
        """Choose bounds between which medians are expected."""
        self._low, self._high = _bracket(values.ravel(), count)
        self._among = [values[:0, 0]] * self._height


def _bracket(values: NDArray[np.float32], count: int) -> tuple[np.float32, np.float32]:
    """Return bounds around the median of the `count` smallest values (N,), from a sample."""
    share = 0.5 * count / values.size
    sample = np.sort(values[:: max(values.size // SAMPLES, 1)])
    low, high = (
        sample[int(np.clip(part * sample.size, 0, sample.size - 1))]
        for part in (share - MARGIN, share + MARGIN)
    )
    return low, high
