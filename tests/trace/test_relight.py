"""The relighting ratio."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.filter.mask import STRONG_FRAMES
from iprt.settings.features import TOUCHED_FRAMES
from iprt.trace.relight import Relight
from tests.filter.gbuffer import SIZES, GBuffer, flat_gbuffer, random_gbuffer, read, upload
from tests.trace.even_cache import WORLD, EvenCache

BLACK = np.zeros(3)
ESTIMATORS = ["delta", "ratio"]


def run(
    device: ComputeDevice,
    gbuffer: GBuffer,
    signal: np.ndarray,
    seen: np.ndarray = BLACK,
    irradiance: np.ndarray | None = None,
    touched: np.ndarray | None = None,
    variance: np.ndarray | None = None,
    clamp: float = 4.0,
) -> np.ndarray:
    """(4, H, W) ratio, where the camera saw the radiance `seen`, one color.

    With an `irradiance`, one color, the signal is relative to it, and may have a `variance`,
    (H, W). `touched` is written to.
    """
    layout = gbuffer.layout
    guide = gbuffer.guide(device)
    delta = irradiance is not None
    noise = None if variance is None else upload(device, layout, variance[None])
    relight = Relight(
        device,
        guide,
        noise,
        delta=delta,
        sun=False,
        added_light=False,
        clamp=clamp,
        name="test",
    )
    color = np.tile(seen[:, None, None], (1, *signal.shape[1:]))
    planes, seen_planes = (upload(device, layout, image) for image in (signal, color))
    cache: Any = None if irradiance is None else EvenCache(device, irradiance)
    before = np.zeros((layout.height, layout.width)) if touched is None else touched
    remembered = upload(device, layout, before[None])
    relight.run(planes, seen_planes, WORLD, cache, remembered)
    if touched is not None:
        touched[:] = read(device, layout, remembered)[0]
    shape = (layout.height, layout.width, 4)
    return np.moveaxis(device.read(relight.ratio).reshape(shape), -1, 0)


def relit(
    device: ComputeDevice,
    estimator: str,
    real: np.ndarray,
    both: np.ndarray,
    seen: np.ndarray = BLACK,
) -> np.ndarray:
    """(3,) ratio where E_R and E_RV are the same everywhere, (3,) each."""
    if estimator == "ratio":
        signal, irradiance = np.concatenate([real, both]), None
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            change = np.where(both == real, 0.0, both / real - 1.0)
        signal = np.concatenate([np.fmax(-change, 0.0), np.fmax(change, 0.0)])
        irradiance = real
    planes = np.tile(signal[:, None, None], (1, 2, 2))
    return run(device, flat_gbuffer(2, 2), planes, seen, irradiance)[:3, 0, 0]


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_quotient_on_surfaces(device: ComputeDevice, width: int, height: int) -> None:
    gbuffer = random_gbuffer(width, height, equirect=False)
    signal = np.random.default_rng(0).uniform(0.1, 1.5, (6, height, width))
    ratio = run(device, gbuffer, signal)
    expected = np.clip(signal[3:] / signal[:3], 0.0, 4.0)
    expected = np.where(gbuffer.seen_ids > 0.0, expected, 1.0)
    np.testing.assert_allclose(ratio[:3], expected, rtol=1e-6)
    assert np.all(ratio[3] == 1.0)


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_change_on_surfaces(device: ComputeDevice, width: int, height: int) -> None:
    """1 + bounce - blocked; no more is blocked than arrives, nothing negative bounces."""
    gbuffer = random_gbuffer(width, height, equirect=False)
    signal = np.random.default_rng(0).uniform(-0.2, 1.4, (6, height, width))
    signal[:, : height // 2] = 0.0
    irradiance = np.array([0.5, 1.0, 7.0])
    ratio = run(device, gbuffer, signal, irradiance=irradiance)
    blocked, bounce = np.clip(signal[:3], 0.0, 1.0), np.maximum(signal[3:], 0.0)
    expected = np.clip(1.0 + bounce - blocked, 0.0, 4.0)
    expected = np.where(gbuffer.seen_ids > 0.0, expected, 1.0)
    np.testing.assert_allclose(ratio[:3], expected, rtol=1e-5, atol=1e-6)
    assert np.all(ratio[3] == 1.0)
    assert np.all(ratio[:, : height // 2] == 1.0)


@pytest.mark.parametrize("clamp", [1.0, 2.5, 1e4])
@pytest.mark.parametrize("irradiance", [None, np.ones(3)], ids=["ratio", "delta"])
def test_brightening_ends_at_the_clamp(
    device: ComputeDevice, clamp: float, irradiance: np.ndarray | None
) -> None:
    """Irradiance grows by 0 to 100 times the room's, in 64 pixels."""
    gbuffer = flat_gbuffer(64, 2)
    more = np.linspace(0.0, 100.0, 64)
    signal = np.zeros((6, 2, 64))
    signal[:3], signal[3:] = (1.0, 1.0 + more) if irradiance is None else (0.0, more)
    ratio = run(device, gbuffer, signal, irradiance=irradiance, clamp=clamp)
    expected = np.broadcast_to(np.minimum(1.0 + more, clamp), (3, 2, 64))
    np.testing.assert_allclose(ratio[:3], expected, rtol=1e-5)


def test_equal_irradiance_is_exactly_one(device: ComputeDevice) -> None:
    gbuffer = flat_gbuffer(64, 48)
    signal = np.random.default_rng(1).gamma(0.2, 3.0, (3, 48, 64))
    assert np.all(run(device, gbuffer, np.concatenate([signal, signal])) == 1.0)
    # What is blocked comes back: up to rounding, whatever the irradiance and what was seen.
    change = np.concatenate([np.minimum(signal, 1.0)] * 2)
    seen = np.array([3.0, 0.2, 0.0])
    ratio = run(device, gbuffer, change, seen, irradiance=np.array([0.3, 0.7, 1.1]))
    np.testing.assert_allclose(ratio, 1.0, atol=3e-7)


@pytest.mark.parametrize("estimator", ESTIMATORS)
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
def test_extremes(
    device: ComputeDevice, real: float, both: float, expected: float, estimator: str
) -> None:
    ratio = relit(device, estimator, np.full(3, real), np.full(3, both))
    np.testing.assert_allclose(ratio, np.float32(expected), rtol=1e-6)


def test_change_is_remembered_where_it_is_large(device: ComputeDevice) -> None:
    """Longer where it is larger; what is remembered already is not forgotten."""
    gbuffer = flat_gbuffer(6, 4)
    signal = np.zeros((6, 4, 6))
    signal[1, :, 1], signal[5, :, 2], signal[0, :, 3], signal[3, :, 4] = 0.3, 0.3, 0.04, 0.005
    touched = np.zeros((4, 6))
    touched[2], touched[3] = 3.0, 1e3
    run(device, gbuffer, signal, irradiance=np.ones(3), touched=touched)
    strong, faint = STRONG_FRAMES, TOUCHED_FRAMES
    np.testing.assert_array_equal(touched[0], [0.0, strong, strong, faint, 0.0, 0.0])
    np.testing.assert_array_equal(touched[2], [3.0, strong, strong, faint, 3.0, 3.0])
    np.testing.assert_array_equal(touched[3], 1e3)


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("estimator", ESTIMATORS)
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
    estimator: str,
) -> None:
    r, b, c = (np.array(rgb) for rgb in (real, both, seen))
    ratio = relit(device, estimator, r, b, c)
    unexplained = np.maximum(c - r, 0.0)
    passing = min(LUMINANCE @ b / (LUMINANCE @ r), 1.0)
    share = (r / np.maximum(r, c)).min()
    blocked = (b + passing * unexplained) / (r + unexplained)
    np.testing.assert_allclose(ratio, passing + share * (blocked - passing), rtol=1e-5)
    # At most what a white surface would add of the light that objects send it.
    assert (ratio <= 1.0 + np.maximum(b - r, 0.0) / np.maximum(r, c) + 1e-6).all()
    if (c <= r).all():
        np.testing.assert_allclose(ratio, b / r, rtol=1e-5)
