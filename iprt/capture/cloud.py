"""Samples of the real surfaces, in a hash grid with probabilistic replacement.

After section 5 of *Natural Environment Illumination*, where an address holds one sample. Here it
holds several, because a cell of 5 cm is large compared with the texels of a panorama.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

CELL_M = 0.05
SLOTS = 32
"""Samples per address."""
BUCKETS = 2**17
"""Number of addresses, with room for 4 million samples."""
_PRIMES = (73856093, 19349663, 83492791)

Float = NDArray[np.float32]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Samples:
    """Samples of the real surfaces.

    Attributes
    ----------
    position : (N, 3) float32
        Metres, in the scene's axes.
    color : (N, 3) float32
        Linear radiance, in the colors of the first frame.
    normal : (N, 3) float32
        Unit vectors, facing the observing camera.
    radius : (N,) float32
        Metres: half the distance to the neighbours in the sample's frame.
    clipped : (N,) bool
        The surface may be brighter than its color.
    """

    position: Float
    color: Float
    normal: Float
    radius: Float
    clipped: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.position)

    def at(self, index: Indices) -> Samples:
        """Return the samples of these indices."""
        return Samples(*(getattr(self, field.name)[index] for field in fields(self)))


class Cloud:
    """A hash grid that never holds more than `buckets * slots` samples.

    All samples that arrive at an address are equally likely to be kept (Vitter's algorithm R). The
    n-th takes a free slot, or replaces a random one with probability slots / n.

    Parameters
    ----------
    seed : int
        Seed of the random numbers.
    buckets, slots : int
        Number of addresses, and of samples per address.
    """

    def __init__(self, seed: int = 0, *, buckets: int = BUCKETS, slots: int = SLOTS) -> None:
        self._random = np.random.default_rng(seed)
        self._buckets, self._slots = buckets, slots
        size = buckets * slots
        self._held = Samples(
            np.full((size, 3), np.nan, np.float32),
            np.zeros((size, 3), np.float32),
            np.zeros((size, 3), np.float32),
            np.zeros(size, np.float32),
            np.zeros(size, bool),
        )
        self._arrived = np.zeros(buckets, np.int64)

    @property
    def nbytes(self) -> int:
        """Bytes of memory."""
        arrays = (getattr(self._held, field.name) for field in fields(self._held))
        return int(sum(array.nbytes for array in arrays) + self._arrived.nbytes)

    @property
    def positions(self) -> Float:
        """(buckets * slots, 3) positions, NaN in free slots; do not modify them."""
        return self._held.position

    def samples(self) -> Samples:
        """Return all samples."""
        return self._held.at(np.flatnonzero(np.isfinite(self._held.position[:, 0])))

    def insert(self, samples: Samples) -> None:
        """Offer samples in order."""
        bucket = self._address(samples.position)
        order = np.argsort(bucket, kind="stable")
        bucket = bucket[order]
        starts = np.flatnonzero(np.diff(bucket, prepend=-1))
        count = np.diff(starts, append=len(bucket))
        number = self._arrived[bucket] + np.arange(len(bucket)) - np.repeat(starts, count)
        slot = np.where(
            number < self._slots, number, self._random.integers(0, np.maximum(number, 0) + 1)
        )
        kept = slot < self._slots
        place, source = (bucket * self._slots + slot)[kept], order[kept]
        # Among several samples for one slot, the last one wins.
        place, last = np.unique(place[::-1], return_index=True)
        source = source[::-1][last]
        for field in fields(samples):
            getattr(self._held, field.name)[place] = getattr(samples, field.name)[source]
        self._arrived[bucket[starts]] += count

    def remove(self, slot: Indices) -> None:
        """Free these slots for the next samples at their addresses."""
        if not len(slot):
            return
        self._held.position[slot] = np.nan
        bucket = np.unique(slot // self._slots)
        slots = bucket[:, None] * self._slots + np.arange(self._slots)
        free = np.isnan(self._held.position[slots, 0])
        source = np.take_along_axis(slots, np.argsort(free, axis=1, kind="stable"), axis=1)
        for field in fields(self._held):
            values = getattr(self._held, field.name)
            values[slots] = values[source]
        self._arrived[bucket] = self._slots - free.sum(axis=1)

    def _address(self, position: Float) -> NDArray[np.int64]:
        cell = np.floor(position / np.float32(CELL_M)).astype(np.int64)
        mixed = (cell * np.array(_PRIMES)).astype(np.uint64)
        key = mixed[:, 0] ^ mixed[:, 1] ^ mixed[:, 2]
        # Finalise as in MurmurHash3: the products alone keep rows of cells together.
        key ^= key >> np.uint64(33)
        key *= np.uint64(0xFF51AFD7ED558CCD)
        key ^= key >> np.uint64(33)
        return np.asarray(key % np.uint64(self._buckets), np.int64)
