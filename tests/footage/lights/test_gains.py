"""Gains from shading alone: what the fit finds, and what bounds it where shading tells nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.footage.lights.gains import MAX_GAIN, MAX_REFLECTANCE, Shading, clip_gains
from tests.worlds import Float

NONE = np.zeros(0, np.intp)


def shading(radiance: Float, segment: Float, rest: Float, lights: Float) -> Shading:
    empty = np.zeros((0, 3))
    none = np.zeros((0, 3, lights.shape[2]))
    return Shading(radiance, segment.astype(np.intp), rest, lights, empty, NONE, empty, none)


def lit(gains: Float, noise: float, seed: int = 0) -> Shading:
    """Ten segments of thirty points each under lights of these gains (K, 3)."""
    rng = np.random.default_rng(seed)
    lights = rng.gamma(1.0, 0.1, (300, 1, len(gains))) * np.ones((1, 3, 1))
    rest = rng.uniform(0.3, 0.6, (300, 1)) * np.ones((1, 3))
    segment = np.repeat(np.arange(10), 30)
    reflectance = rng.uniform(0.1, 0.8, (10, 3))[segment]
    received = rest + np.einsum("nck,kc->nc", lights, gains)
    radiance = reflectance / np.pi * received * np.exp(noise * rng.normal(size=(300, 3)))
    return shading(radiance, segment, rest, lights)


@pytest.mark.parametrize("outliers", [0, 60])
def test_gains_of_several_lights_and_colors(outliers: int) -> None:
    """Also where a fifth of the points shows something else, highlights or paint."""
    gains = np.array([[4.0, 5.0, 8.0], [30.0, 20.0, 10.0], [1.0, 1.0, 1.0]])
    seen = lit(gains, 0.05)
    rng = np.random.default_rng(1)
    spoilt = rng.permutation(300)[:outliers]
    seen.radiance[spoilt] *= rng.uniform(5.0, 10.0, (outliers, 1))
    found = clip_gains(seen, [], np.ones((3, 3), bool))
    np.testing.assert_allclose(found.gain[:2], gains[:2], rtol=0.2 if outliers else 0.1)
    assert (found.gain[2] < 2.0).all()
    assert (found.gain >= 1.0).all()


def test_channels_that_are_not_clipped_keep_their_light() -> None:
    gains = np.array([[6.0, 1.0, 1.0]])
    found = clip_gains(lit(gains, 0.02), [], np.array([[True, False, False]]))
    assert found.gain[0, 0] == pytest.approx(6.0, rel=0.2)
    assert (found.gain[0, 1:] == 1.0).all()


def test_energy_balance_tells_of_light_whose_shading_is_flattened() -> None:
    """Tone mapping evens out each white wall, whose shading then says that no light is missing."""
    true = lit(np.full((1, 3), 5.0), 0.0)
    received = true.rest + 5.0 * true.lights[..., 0]
    mean = np.stack([received[true.segment == number].mean(0) for number in range(10)])
    white = replace(true, radiance=0.85 / np.pi * mean[true.segment])
    found = clip_gains(white, [], np.ones((1, 3), bool))
    np.testing.assert_allclose(found.gain, 5.0, rtol=0.25)


@pytest.mark.parametrize("shine", [0.01, 0.1, 0.5])
def test_no_surface_reflects_more_than_it_receives(shine: float) -> None:
    """Single points, whose shading tells nothing: light must come from somewhere, and not more."""
    n = 40
    rng = np.random.default_rng(2)
    level = shine * 10.0 ** rng.uniform(-2.0, 0.0, (n, 1)) * np.ones((1, 3))
    rest, lights = np.full((n, 3), 0.05), np.full((n, 3, 1), 0.1)
    found = clip_gains(shading(level, np.arange(n), rest, lights), [], np.ones((1, 3), bool))
    reflectance = np.pi * level / (rest + lights[..., 0] * found.gain[0])
    assert reflectance.max() <= 1.4 * MAX_REFLECTANCE
    assert np.median(reflectance) >= 0.02
    assert (found.gain >= 1.0).all()
    assert (found.gain < 100.0).all()


def test_what_no_light_explains_stays_bounded() -> None:
    """A point that the light does not reach shines a million times as strong as it can."""
    seen = shading(np.full((5, 3), 1e6), np.arange(5), np.full((5, 3), 1e-3), np.zeros((5, 3, 1)))
    found = clip_gains(seen, [], np.ones((1, 3), bool))
    assert np.isfinite(found.gain).all()
    assert (found.gain >= 1.0).all()
    assert (found.gain <= MAX_GAIN).all()
