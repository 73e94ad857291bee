"""The hash grid: never too many, an even chance for each sample, freed slots are taken again."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chisquare

from iprt.capture.cloud import CELL_M, Cloud, Samples


def samples(position: NDArray[np.float64], first: int = 0) -> Samples:
    """Samples whose radius is their number."""
    number = np.arange(first, first + len(position), dtype=np.float32)
    same = np.repeat(number[:, None], 3, axis=1)
    return Samples(position.astype(np.float32), same, same, number, number % 2 == 1)


def in_a_cell(count: int) -> NDArray[np.float64]:
    return np.full((count, 3), 0.5 * CELL_M)


def test_the_limit_holds_and_all_that_fits_is_kept() -> None:
    random = np.random.default_rng(0)
    cloud = Cloud(buckets=8, slots=4)
    for first in range(0, 1000, 100):
        cloud.insert(samples(random.uniform(-3, 3, (100, 3)), first))
        assert len(cloud.samples()) <= 32
    assert len(cloud.samples()) == 32
    few = Cloud(buckets=2**12, slots=4)
    few.insert(samples(random.uniform(-9, 9, (100, 3))))
    assert sorted(few.samples().radius) == list(range(100))


def test_attributes_stay_together() -> None:
    cloud = Cloud(buckets=4, slots=8)
    position = np.random.default_rng(1).uniform(-1, 1, (500, 3))
    for first in range(0, 500, 50):
        cloud.insert(samples(position[first : first + 50], first))
    held = cloud.samples()
    number = held.radius.astype(int)
    assert len(np.unique(number)) == len(number) == 32
    np.testing.assert_array_equal(held.position, position[number].astype(np.float32))
    np.testing.assert_array_equal(held.color[:, 1], held.radius)
    np.testing.assert_array_equal(held.normal[:, 2], held.radius)
    np.testing.assert_array_equal(held.clipped, number % 2 == 1)


@pytest.mark.thorough
def test_every_sample_has_the_same_chance() -> None:
    """However they arrive: in one frame, or in frames of different sizes."""
    arrivals, slots, trials = 40, 8, 1500
    sizes = [3, 17, 1, 19]
    for frames in ([arrivals], sizes):
        held = np.zeros(arrivals)
        for seed in range(trials):
            cloud = Cloud(seed, buckets=1, slots=slots)
            first = 0
            for size in frames:
                cloud.insert(samples(in_a_cell(size), first))
                first += size
            held[cloud.samples().radius.astype(int)] += 1
        assert held.sum() == slots * trials
        # Draws without replacement vary a little less than a multinomial: the test is mild.
        assert chisquare(held).pvalue > 1e-3


def test_removed_samples_are_gone_and_their_slots_taken() -> None:
    cloud = Cloud(buckets=1, slots=8)
    cloud.insert(samples(in_a_cell(8)))
    cloud.remove(np.array([1, 2, 6]))
    assert sorted(cloud.samples().radius) == [0, 3, 4, 5, 7]
    cloud.insert(samples(in_a_cell(3), 100))
    assert sorted(cloud.samples().radius) == [0, 3, 4, 5, 7, 100, 101, 102]


def test_neighbouring_cells_spread_over_addresses() -> None:
    """A wall of 100 x 100 cells: as many addresses are taken as chance takes."""
    y, x = np.indices((100, 100)).reshape(2, -1)
    wall = np.stack([x + 0.5, y - 49.5, np.full(len(x), -20.5)], axis=1) * CELL_M
    buckets = 2**13
    cloud = Cloud(buckets=buckets, slots=1)
    cloud.insert(samples(wall))
    expected = buckets * (1.0 - np.exp(-len(wall) / buckets))
    assert abs(len(cloud.samples()) - expected) < 5.0 * np.sqrt(expected * 0.3)
