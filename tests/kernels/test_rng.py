"""cl/lib/maths/rng.h: hashes that scatter, numbers that fill [0, 1)."""

import numpy as np
from scipy.stats import chi2

from tests.kernels.wrap import evaluate

COUNT = 1 << 16
COUNTER = np.arange(COUNT, dtype=np.uint32)


def hashed(device, body, **inputs):
    return evaluate(device, ["maths/rng.h"], body, inputs, {"h": "uint"})["h"]


def assert_uniform(values, bins, p=1e-4):
    counts = np.bincount((values * bins).astype(int), minlength=bins)
    expected = len(values) / bins
    statistic = np.sum((counts - expected) ** 2) / expected
    assert chi2.sf(statistic, bins - 1) > p


def test_the_hash_is_a_bijection_with_avalanche(device):
    h = hashed(device, "h = hash_u32(x);", x=COUNTER)
    assert len(np.unique(h)) == COUNT
    for bit in range(32):
        flipped = hashed(device, "h = hash_u32(x);", x=COUNTER ^ np.uint32(1 << bit))
        changed = np.unpackbits((h ^ flipped)[:, None].view(np.uint8), axis=1).mean(axis=0)
        assert np.all(np.abs(changed - 0.5) < 0.03)


def test_combine_is_ordered_and_injective_in_each_argument(device):
    zero = np.zeros_like(COUNTER)
    by_value = hashed(device, "h = hash_combine(a, b);", a=zero, b=COUNTER)
    by_seed = hashed(device, "h = hash_combine(a, b);", a=COUNTER, b=zero)
    assert len(np.unique(by_value)) == len(np.unique(by_seed)) == COUNT
    assert np.mean(by_value == by_seed) < 1e-3
    # A grid of small seeds and values, as pixels and frames are, collides only by chance.
    a, b = (g.ravel().astype(np.uint32) for g in np.meshgrid(np.arange(256), np.arange(256)))
    assert len(np.unique(hashed(device, "h = hash_combine(a, b);", a=a, b=b))) > COUNT - 5


def test_counters_become_equidistributed_numbers(device):
    body = "u = u01(hash_combine(7u, x));"
    u = evaluate(device, ["maths/rng.h"], body, {"x": COUNTER}, {"u": "float"})["u"]
    assert u.min() >= 0
    assert u.max() < 1
    assert_uniform(u.astype(float), 256)
    pairs = (u[:-1] * 16).astype(int) * 16 + (u[1:] * 16).astype(int)
    assert_uniform((pairs + 0.5) / 256, 256)


def test_u01_never_rounds_to_one(device):
    x = np.array([0, 255, 256, 2**32 - 1], np.uint32)
    u = evaluate(device, ["maths/rng.h"], "u = u01(x);", {"x": x}, {"u": "float"})["u"]
    np.testing.assert_array_equal(u, np.float32([0, 0, 2**-24, 1 - 2**-24]))
