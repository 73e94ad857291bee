"""Maps of parameters that kernels read by the index of a material: palettes of materials."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from iprt.geometry.sampler import PLAIN, Sampler

MOST_VARIANTS = 256
"""Most materials of a map."""
MOST_DISTINCT = 2**16
"""Distinct texels beyond which low bits are dropped before they are grouped."""
_PLANES_AT_ONCE = 4
"""Planes of bytes that fit into the numbers that are sorted, beside the rank of earlier ones."""
_ROUNDS = 8
"""Rounds of Lloyd's algorithm."""

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Variants:
    """A map of a material's parameters.

    Attributes
    ----------
    names : tuple of str
        Attributes of `Material`.
    values : tuple of tuple
        Their values, per variant.
    index : (H, W) uint8
        Variant of each texel, row 0 at v = 1.
    sampler : Sampler
        How the map is read. Between texels, and where several are seen at once, one is drawn at
        random.
    """

    names: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]
    index: NDArray[np.uint8] = field(compare=False)
    sampler: Sampler = PLAIN

    def without(self, names: Collection[str]) -> Variants | None:
        """Return the map without some attributes; None if no others are left."""
        kept = [number for number, name in enumerate(self.names) if name not in names]
        if not kept:
            return None
        rows = tuple(tuple(row[number] for number in kept) for row in self.values)
        return Variants(tuple(self.names[n] for n in kept), rows, self.index, self.sampler)


def distinct(planes: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return the distinct columns of planes of texels, and the number of each texel's.

    Where there are more than about `MOST_DISTINCT`, the lowest bits are dropped.

    Parameters
    ----------
    planes : (C, T) uint8

    Returns
    -------
    values : (N, C) uint8
    number : (T,) int64
    """
    step = max(planes.shape[1] // 2**18, 1)
    dropped = 0
    while _numbered(_rounded(planes[:, ::step], dropped)).max() >= MOST_DISTINCT:
        dropped += 1
    rounded = _rounded(planes, dropped)
    number = _numbered(rounded)
    some = np.empty(int(number.max()) + 1, np.int64)
    some[number] = np.arange(len(number))
    return rounded[:, some].T, number


def _rounded(planes: NDArray[np.uint8], dropped: int) -> NDArray[np.uint8]:
    """Return planes with the middle of the range of their lowest bits in place of these."""
    middle = (1 << dropped) >> 1
    return np.asarray((planes >> dropped << dropped) + middle, np.uint8)


def _numbered(planes: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the rank of each texel among the distinct ones."""
    number = np.zeros(planes.shape[1], np.int64)
    for first in range(0, len(planes), _PLANES_AT_ONCE):
        for plane in planes[first : first + _PLANES_AT_ONCE]:
            number = (number << 8) | plane
        number = np.unique(number, return_inverse=True)[1]
    return number


def grouped(values: Float, weights: Float, most: int = MOST_VARIANTS) -> NDArray[np.int64]:
    """Return the group of each of N points, of at most `most` groups of similar points.

    The group of the largest squared error is split at its mean until there are enough. Then
    each point joins the group of the nearest mean, for a few rounds (S. Lloyd, "Least Squares
    Quantization in PCM", IEEE Transactions on Information Theory 28(2), 1982).

    Parameters
    ----------
    values : (N, D) float64
    weights : (N,) float64
        Positive.

    Returns
    -------
    (N,) int64
        From 0 on; none is empty.
    """
    if len(values) <= most:
        return np.arange(len(values))
    parts = [(*_spread(values, weights), np.arange(len(values)))]
    while len(parts) < most:
        error, axis, middle, members = parts.pop(int(np.argmax([part[0] for part in parts])))
        if not error > 0.0:
            parts.append((error, axis, middle, members))
            break
        above = values[members, axis] > middle
        halves = members[above], members[~above]
        parts += [(*_spread(values[half], weights[half]), half) for half in halves]
    group = np.empty(len(values), np.int64)
    for number, (*_, members) in enumerate(parts):
        group[members] = number
    for _ in range(_ROUNDS):
        centres = means(values, weights, group)
        group = np.unique(cKDTree(centres).query(values)[1], return_inverse=True)[1]
    return group


def means(values: Float, weights: Float, group: NDArray[np.int64]) -> Float:
    """Return the (G, D) weighted means of groups of points (N, D)."""
    total = np.bincount(group, weights)
    sums = [np.bincount(group, weights * column) for column in values.T]
    return np.asarray(np.stack(sums, axis=1) / total[:, None])


def _spread(values: Float, weights: Float) -> tuple[float, int, float]:
    """Return the squared error of points around their mean, and the axis of most and its mean."""
    middle = np.average(values, axis=0, weights=weights)
    errors = weights @ np.square(values - middle)
    axis = int(np.argmax(errors))
    # Rounding may put the mean of equal values beside them.
    split = values[:, axis].max() > values[:, axis].min()
    return float(errors.sum()) if split else 0.0, axis, float(middle[axis])
