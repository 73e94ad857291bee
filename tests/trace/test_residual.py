"""Noise left by the spatial filter is drawn to its surroundings, as far as its variance says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from tests.filter.gbuffer import SIZES, Array, GBuffer, flat_gbuffer, random_gbuffer
from tests.trace.test_relight import run

SPREAD, NEGLIGIBLE, PLANE = 0.1, 1e-3, 0.003
"""As in `cl/lib/filter/residual.h`."""
EVEN = np.ones(3)


def settled(gbuffer: GBuffer, signal: Array, variance: Array) -> Array:
    """Twin of the kernel, pixel by pixel: (6, H, W)."""
    height, width = variance.shape
    result = signal.copy()
    at, normal, ids = gbuffer.position, gbuffer.normal, gbuffer.seen_ids
    for y, x in np.argwhere((variance > NEGLIGIBLE) & (ids > 0.0)):
        total, weights = np.zeros(6), 0.0
        for row in range(max(y - 2, 0), min(y + 3, height)):
            for across in range(x - 2, x + 3):
                column = across % width if gbuffer.equirect else across
                outside = not 0 <= column < width
                if outside or (row, across) == (y, x) or ids[row, column] != ids[y, x]:
                    continue
                apart = at[:, row, column] - at[:, y, x]
                off = min(abs(normal[:, y, x] @ apart), abs(normal[:, row, column] @ apart))
                off /= PLANE * np.linalg.norm(at[:, y, x])
                weight = max(1.0 - off / 8.0, 0.0) ** 8 / (SPREAD**2 + variance[row, column])
                total += weight * signal[:, row, column]
                weights += weight
        if weights > 0.0:
            share = (variance[y, x] - NEGLIGIBLE) / (variance[y, x] + SPREAD**2)
            result[:, y, x] += share * (total / weights - signal[:, y, x])
    return result


def ratio_of(signal: Array) -> Array:
    """(3, H, W), where E_R is 1."""
    blocked, bounce = np.clip(signal[:3], 0.0, 1.0), np.maximum(signal[3:], 0.0)
    return np.clip(1.0 + bounce - blocked, 0.0, 4.0)


def ridged(width: int, height: int) -> GBuffer:
    """A wall with an edge of one pixel down its middle, which faces to the side."""
    wall = flat_gbuffer(width, height)
    normal = wall.normal.copy()
    normal[:, :, width // 2] = np.array([0.8, 0.0, 0.6])[:, None]
    return replace(wall, normal=normal)


@pytest.mark.parametrize("equirect", [False, True])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_kernel_and_twin_agree(
    device: ComputeDevice, width: int, height: int, equirect: bool
) -> None:
    gbuffer = random_gbuffer(width, height, equirect=equirect, seed=2)
    rng = np.random.default_rng(1)
    signal = rng.uniform(-0.2, 1.4, (6, height, width))
    variance = 10.0 ** rng.uniform(-5.0, 1.0, (height, width))
    ratio = run(device, gbuffer, signal, irradiance=EVEN, variance=variance)
    expected = ratio_of(settled(gbuffer, signal, variance))
    expected = np.where(gbuffer.seen_ids > 0.0, expected, 1.0)
    np.testing.assert_allclose(ratio[:3], expected, atol=2e-4)


def test_what_is_sure_keeps_its_bits(device: ComputeDevice) -> None:
    gbuffer = random_gbuffer(64, 48, equirect=False)
    signal = np.random.default_rng(3).uniform(0.0, 1.0, (6, 48, 64))
    plain = run(device, gbuffer, signal, irradiance=EVEN)
    sure = run(device, gbuffer, signal, irradiance=EVEN, variance=np.full((48, 64), NEGLIGIBLE))
    np.testing.assert_array_equal(sure, plain)


@pytest.mark.parametrize("noise", [0.05, 0.3, 2.0])
def test_noise_of_thin_edges_falls(device: ComputeDevice, noise: float) -> None:
    """It falls to the differences in its surroundings, and never grows."""
    width, height = 32, 200
    gbuffer, middle = ridged(width, height), width // 2
    rng = np.random.default_rng(4)
    truth = 0.4 + 0.05 * rng.normal(size=(height, width))
    truth[:, middle] += 0.1
    variance = np.full((height, width), 1e-5)
    variance[:, middle] = noise**2
    signal = np.zeros((6, height, width))
    signal[:3] = truth + np.sqrt(variance) * rng.normal(size=(height, width))
    ratio = run(device, gbuffer, signal, irradiance=EVEN, variance=variance)
    error = ratio[0, :, middle] - (1.0 - truth[:, middle])
    before = np.clip(1.0 - signal[0, :, middle], 0.0, 1.0) - (1.0 - truth[:, middle])
    assert np.sqrt(np.mean(error**2)) < 1.02 * np.sqrt(np.mean(before**2))
    assert np.sqrt(np.mean(error**2)) < 0.14
