"""cl/lib/maths/sampling.h: (0,2)-sequences, decorrelated seeds, frames, the cosine lobe."""

import numpy as np
import pytest

from tests.kernels.wrap import evaluate


def sobol(device, index, seed):
    index = np.asarray(index, np.uint32)
    seed = np.broadcast_to(np.uint32(seed), index.shape).copy()
    body = "p = sobol_2d(index, seed);"
    inputs = {"index": index, "seed": seed}
    return evaluate(device, ["maths/sampling.h"], body, inputs, {"p": "float2"})["p"]


def sobol_by_direction_numbers(index):
    """(N, 2) float64: unscrambled Sobol points from the direction numbers, one index bit at a
    time (Bratley and Fox 1988: dimension 1 has the primitive polynomial x + 1)."""
    direction = [1 << 31]
    for _ in range(31):
        direction.append(direction[-1] ^ (direction[-1] >> 1))
    points = np.zeros((len(index), 2), np.uint64)
    for bit in range(32):
        on = (index >> bit) & 1
        points[:, 0] ^= np.uint64(1 << (31 - bit)) * on.astype(np.uint64)
        points[:, 1] ^= np.uint64(direction[bit]) * on.astype(np.uint64)
    return points / 2.0**32


def assert_net(points, k):
    """Every elementary interval of area 2^-k holds exactly one of the 2^k points."""
    for a in range(k + 1):
        cells = (points * [2**a, 2 ** (k - a)]).astype(int)
        assert len(np.unique(cells[:, 0] * 2 ** (k - a) + cells[:, 1])) == 2**k


def test_second_dimension_equals_the_direction_numbers(device):
    rng = np.random.default_rng(1)
    index = np.concatenate([np.arange(64), rng.integers(0, 2**32, 1000)]).astype(np.uint32)
    body = "y = u01(reverse_bits(sobol_1_reversed(index)));"
    y = evaluate(device, ["maths/sampling.h"], body, {"index": index}, {"y": "float"})["y"]
    expected = sobol_by_direction_numbers(index.astype(np.uint64))[:, 1]
    np.testing.assert_allclose(y, expected, atol=2**-24)


@pytest.mark.parametrize("seed", [0, 1, 0x9E3779B9, 0xFFFFFFFF])
@pytest.mark.parametrize("start", [0, 1 << 20])
def test_every_power_of_two_is_a_net(device, seed, start):
    points = sobol(device, start + np.arange(256), seed)
    assert points.min() >= 0
    assert points.max() < 1
    for k in range(9):
        assert_net(points[: 2**k], k)


def test_seeds_give_independent_uniform_points(device):
    # Pixels are neighbouring seeds: each point alone must be uniform, pairs uncorrelated.
    seeds = np.arange(1 << 14, dtype=np.uint32)
    for index in (0, 1, 5):
        p = sobol(device, np.full(seeds.shape, index), seeds).astype(float)
        cells = (p * 8).astype(int)
        counts = np.bincount(cells[:, 0] * 8 + cells[:, 1], minlength=64)
        expected = len(seeds) / 64
        assert np.sum((counts - expected) ** 2 / expected) < 63 + 5 * np.sqrt(2 * 63)
        neighbours = np.corrcoef(p[:-1, 0], p[1:, 0])[0, 1]
        dimensions = np.corrcoef(p[:, 0], p[:, 1])[0, 1]
        assert abs(neighbours) < 5 / np.sqrt(len(seeds))
        assert abs(dimensions) < 5 / np.sqrt(len(seeds))


def unit_vectors(count):
    rng = np.random.default_rng(3)
    v = rng.normal(size=(count, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    axes = np.concatenate([np.eye(3), -np.eye(3), [[0, -0.0, -1], [1e-4, 1e-20, -1]]])
    poles = v[:1000] * [1e-4, 1e-4, 0] + [0, 0, -1]
    poles /= np.linalg.norm(poles, axis=1, keepdims=True)
    return np.concatenate([v, axes, poles]).astype(np.float32)


def test_frames_are_orthonormal_and_right_handed(device):
    n = unit_vectors(100_000)
    body = "const Frame f = build_frame(n); x = f.x; y = f.y; z = f.z;"
    outputs = dict.fromkeys("xyz", "float3")
    out = evaluate(device, ["maths/sampling.h"], body, {"n": n}, outputs)
    basis = np.stack([out["x"], out["y"], out["z"]], axis=1).astype(float)
    gram = basis @ basis.transpose(0, 2, 1)
    assert np.abs(gram - np.eye(3)).max() < 2e-6
    assert np.abs(np.linalg.det(basis) - 1).max() < 3e-6
    np.testing.assert_array_equal(out["z"], n)


def test_cosine_directions_follow_their_density(device):
    rng = np.random.default_rng(4)
    u = rng.random((1 << 17, 2), dtype=np.float32)
    u[:4] = [[0, 0], [0, 1 - 2**-24], [1 - 2**-24, 0], [1 - 2**-24, 1 - 2**-24]]
    d = evaluate(device, ["maths/sampling.h"], "d = sample_cosine(u);", {"u": u}, {"d": "float3"})[
        "d"
    ]
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-6)
    assert d[:, 2].min() > 0
    # Under cos/pi, cos² is uniform and independent of the uniform azimuth.
    azimuth = np.arctan2(d[:, 1], d[:, 0]) / (2 * np.pi) % 1
    cells = (azimuth * 16).astype(int) * 16 + np.minimum((d[:, 2] ** 2 * 16).astype(int), 15)
    counts = np.bincount(cells, minlength=256)
    expected = len(u) / 256
    assert np.sum((counts - expected) ** 2 / expected) < 255 + 4 * np.sqrt(2 * 255)


def rotated(device, index, dimensions, seed):
    index = np.asarray(index, np.uint32)
    inputs = {
        "index": index,
        "dimensions": np.full_like(index, dimensions),
        "seed": np.full_like(index, seed),
    }
    body = "p = rotated_sobol(index, dimensions, seed);"
    return evaluate(device, ["maths/sampling.h"], body, inputs, {"p": "float2"})["p"]


@pytest.mark.parametrize("dimensions", [0, 1, 7])
def test_rotated_points_are_nets_shifted(device, dimensions):
    """Cranley and Patterson's rotation: all points of a seed are moved alike, around the square."""
    index = np.arange(256)
    inputs = {"index": index.astype(np.uint32)}
    body = f"""
    const uint s = hash_combine(5, {dimensions});
    shift = (float2)(u01(s), u01(hash_u32(s ^ 0x2f0b4c47u)));"""
    shift = evaluate(device, ["maths/sampling.h"], body, inputs, {"shift": "float2"})["shift"]
    points = rotated(device, index, dimensions, 5).astype(np.float64)
    assert points.min() >= 0
    assert points.max() < 1
    unmoved = np.mod(points - shift.astype(np.float64) + 2.0**-23, 1.0)
    for k in range(9):
        assert_net(unmoved[: 2**k], k)
    others = rotated(device, index, dimensions, 6).astype(np.float64)
    moved = (others - points) % 1.0
    assert np.ptp((moved - moved[0] + 0.5) % 1.0) < 1e-6
    assert 1e-3 < moved[0].min() < moved[0].max() < 1.0 - 1e-3
