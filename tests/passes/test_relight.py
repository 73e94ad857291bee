"""The relighting ratio."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.passes.relight import Relight
from tests.passes.gbuffer import SIZES, GBuffer, flat_gbuffer, random_gbuffer, upload

BLACK = np.zeros(3)


def run(
    device: ComputeDevice, gbuffer: GBuffer, signal: np.ndarray, seen: np.ndarray = BLACK
) -> np.ndarray:
    """(4, H, W) ratio, where the camera saw the radiance `seen`, one colour."""
    relight = Relight(device, gbuffer.guide(device))
    colour = np.tile(seen[:, None, None], (1, *signal.shape[1:]))
    planes = (upload(device, gbuffer.layout, image) for image in (signal, colour))
    relight.run(*planes, scale=2.0)
    shape = (gbuffer.layout.height, gbuffer.layout.width, 4)
    return np.moveaxis(device.read(relight.ratio).reshape(shape), -1, 0)


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_quotient_on_surfaces(device: ComputeDevice, width: int, height: int) -> None:
    gbuffer = random_gbuffer(width, height, equirect=False)
    signal = np.random.default_rng(0).uniform(0.1, 1.5, (6, height, width))
    ratio = run(device, gbuffer, signal)
    expected = np.clip(signal[3:] / signal[:3], 0.0, 4.0)
    expected = np.where(gbuffer.seen_ids > 0.0, expected, 1.0)
    np.testing.assert_allclose(ratio[:3], expected, rtol=1e-6)
    assert np.all(ratio[3] == 1.0)


def test_equal_irradiance_is_exactly_one(device: ComputeDevice) -> None:
    gbuffer = flat_gbuffer(64, 48)
    signal = np.random.default_rng(1).gamma(0.2, 3.0, (3, 48, 64))
    assert np.all(run(device, gbuffer, np.concatenate([signal, signal])) == 1.0)


@pytest.mark.parametrize(
    ("real", "both", "expected"),
    [
        (0.0, 1.0, 1.0),
        (1e-6, 0.5e-6, 1.0),
        (1.0, 0.0, 0.0),
        (1.0, -0.1, 0.0),
        (0.1, 100.0, 4.0),
        (65504.0, 32752.0, 0.5),
        (np.nan, 1.0, 1.0),
        (1.0, np.nan, 1.0),
        (np.inf, 1.0, 1.0),
        (1.0, np.inf, 1.0),
        (np.inf, np.inf, 1.0),
        (-1.0, 1.0, 1.0),
    ],
)
def test_extremes(device: ComputeDevice, real: float, both: float, expected: float) -> None:
    signal = np.full((6, 2, 2), real)
    signal[3:] = both
    assert np.all(run(device, flat_gbuffer(2, 2), signal)[:3] == np.float32(expected))


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize(
    ("real", "both", "seen"),
    [
        ((1.0, 1.0, 1.0), (0.5, 0.5, 0.5), (3.0, 3.0, 3.0)),
        ((0.46, 0.26, 0.19), (0.40, 0.24, 0.21), (0.59, 0.67, 0.82)),
        ((0.46, 0.26, 0.19), (0.40, 0.36, 0.41), (0.59, 0.67, 0.82)),
        ((1.0, 0.5, 0.2), (0.2, 0.6, 0.3), (0.9, 0.45, 0.18)),
    ],
)
def test_light_that_the_panorama_lacks_is_blocked_like_the_rest(
    device: ComputeDevice,
    real: tuple[float, ...],
    both: tuple[float, ...],
    seen: tuple[float, ...],
) -> None:
    r, b, c = (np.array(rgb) for rgb in (real, both, seen))
    signal = np.tile(np.concatenate([r, b])[:, None, None], (1, 2, 2))
    ratio = run(device, flat_gbuffer(2, 2), signal, c)[:3, 0, 0]
    unexplained = np.maximum(c - r, 0.0)
    passing = min(LUMINANCE @ b / (LUMINANCE @ r), 1.0)
    share = (r / np.maximum(r, c)).min()
    blocked = (b + passing * unexplained) / (r + unexplained)
    np.testing.assert_allclose(ratio, passing + share * (blocked - passing), rtol=1e-5)
    # At most what a white surface would add of the light that objects send it.
    assert (ratio <= 1.0 + np.maximum(b - r, 0.0) / np.maximum(r, c) + 1e-6).all()
    if (c <= r).all():
        np.testing.assert_allclose(ratio, b / r, rtol=1e-5)
