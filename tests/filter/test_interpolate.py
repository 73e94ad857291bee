"""Interpolation of sparse signals against its twin and its promises."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.filter.interpolate import NORMAL_SHARPNESS, PLANE_SHARPNESS, Interpolate
from iprt.filter.signals import Signal
from tests.filter.gbuffer import (
    SIZES,
    GBuffer,
    flat_gbuffer,
    random_gbuffer,
    read,
    tracing_grid,
    upload,
)
from tests.oracles import interpolate as oracle
from tests.oracles import mask as mask_oracle


def run(
    device: ComputeDevice,
    gbuffer: GBuffer,
    level: np.ndarray,
    signal: np.ndarray,
    offset: tuple[int, int],
) -> np.ndarray:
    layout = gbuffer.layout
    planes = upload(device, layout, signal)
    levels = device.upload("level", layout.padded(level[None].astype(np.uint8)))
    signals = [Signal("test", "diffuse" if len(signal) == 3 else "delta", gbuffer.guide(device))]
    Interpolate(device, signals).run([levels], [planes], tracing_grid(device, offset))
    return read(device, layout, planes)


def scene(
    width: int, height: int, equirect: bool, *, seed: int = 3
) -> tuple[GBuffer, np.ndarray, np.ndarray]:
    """G-buffer, levels that do not follow it (all cases occur), and 6-plane signal."""
    rng = np.random.default_rng(seed)
    gbuffer = random_gbuffer(width, height, equirect=equirect)
    level = np.kron(rng.integers(0, 4, (height // 6 + 1, width // 6 + 1)), np.ones((6, 6)))
    level = np.where(gbuffer.seen_ids > 0.0, level[:height, :width], 255).astype(np.uint8)
    return gbuffer, level, gbuffer.listed * (rng.random((6, height, width)) + 0.5)


@pytest.mark.parametrize("equirect", [False, True])
@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("offset", [(0, 0), (3, 1)])
def test_equals_twin(
    device: ComputeDevice, width: int, height: int, equirect: bool, offset: tuple[int, int]
) -> None:
    gbuffer, level, signal = scene(width, height, equirect)
    result = run(device, gbuffer, level, signal, offset)
    expected = oracle.interpolate(
        signal,
        level,
        gbuffer.normal,
        gbuffer.position,
        gbuffer.seen_ids,
        offset,
        (NORMAL_SHARPNESS, PLANE_SHARPNESS),
        equirect,
    )
    np.testing.assert_allclose(result, expected, rtol=2e-3, atol=1e-4)
    traced = mask_oracle.traced(level, offset)
    assert np.array_equal(result[:, traced], signal[:, traced].astype(np.float32))


@pytest.mark.parametrize("level", [1, 2])
def test_linear_functions_on_a_wall_come_back(device: ComputeDevice, level: int) -> None:
    gbuffer = flat_gbuffer(33, 25)
    x, y = np.meshgrid(np.arange(33.0), np.arange(25.0))
    truth = np.stack([1.0 + x, 40.0 - y, 2.0 * x + 3.0 * y])
    levels = np.full((25, 33), level)
    sparse = np.where(mask_oracle.traced(levels, (0, 0)), truth, np.nan)
    np.testing.assert_allclose(run(device, gbuffer, levels, sparse, (0, 0)), truth, rtol=1e-5)


def test_equal_planes_stay_equal(device: ComputeDevice) -> None:
    gbuffer, level, signal = scene(64, 48, False)
    signal[3:] = signal[:3]
    result = run(device, gbuffer, level, signal, (1, 1))
    assert np.array_equal(result[:3], result[3:])


def test_equirect_picture_turns_with_the_view(device: ComputeDevice) -> None:
    gbuffer, level, signal = scene(64, 32, True)
    signal *= gbuffer.seen_ids > 0.0
    result = run(device, gbuffer, level, signal, (1, 2))
    turned = run(device, gbuffer.rolled(4), np.roll(level, 4, 1), np.roll(signal, 4, 2), (1, 2))
    np.testing.assert_allclose(np.roll(result, 4, 2), turned, rtol=2e-3, atol=1e-5)
