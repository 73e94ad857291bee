"""Gains of a sky from shading that was made with known ones."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.footage.found_sky.estimate import estimate_gains
from iprt.footage.found_sky.shading import Shading
from iprt.footage.sky import AZIMUTHS, node_directions

NODE = node_directions()
AHEAD = np.array([1.0, 0.0, 0.0])
SHOWN = NODE[(NODE @ AHEAD > 0.9) & (np.abs(NODE[:, 1]) < 0.3)]
"""Directions that windows show."""


def shading(gain: np.ndarray, *, noise: float = 0.01, albedo: float = 0.4) -> Shading:
    """Points on two surfaces: each is lit from some directions about nodes on one side."""
    rng = np.random.default_rng(2)
    points = 300
    centre = NODE[rng.choice(np.flatnonzero(NODE @ AHEAD > 0.2), points)]
    lobe = np.exp(8.0 * (centre @ NODE.T - 1.0)) * (NODE @ AHEAD > 0.0)
    unseen = 0.5 * rng.random((points, 1)) * lobe
    unseen = unseen[..., None] * np.array([1.0, 1.2, 1.5])
    known = rng.uniform(0.3, 1.0, (points, 1)) * np.array([1.0, 0.9, 0.7])
    segment = (np.arange(points) % 2).astype(np.intp)
    reflectance = albedo * np.array([[1.0, 1.0, 1.0], [1.0, 0.8, 0.6]])[segment]
    received = known + (unseen * gain).sum(axis=1)
    blur = np.exp(noise * rng.normal(size=(points, 3)))
    return Shading(reflectance / np.pi * received * blur, segment, known, unseen, SHOWN)


def error(made: Shading, gain: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Errors (3,) of the mean color and both differences of color, over all points."""
    found, expected = (made.known + (made.unseen * one).sum(axis=1) for one in (gain, truth))
    apart = np.log(found / expected)
    parts = apart.mean(axis=1), apart[:, 0] - apart[:, 1], apart[:, 2] - apart[:, 1]
    return np.array([part.std() for part in parts])


def test_what_is_extrapolated_well_stays() -> None:
    ones = np.ones((len(NODE), 3))
    found = estimate_gains(shading(ones))
    assert found.spread == 0.1
    np.testing.assert_allclose(found.gain, 1.0, atol=0.15)


@pytest.mark.parametrize(
    "high", [(0.6, 1.0, 1.6), (4.0, 4.0, 4.0), (3.0, 5.0, 9.0), (0.2, 0.2, 0.2)]
)
def test_the_light_of_a_sky_is_found(high: tuple[float, float, float]) -> None:
    """The sky differs from the extrapolation above 25 degrees."""
    gain = np.where(NODE[:, 1:2] > 0.42, np.array(high), 1.0)
    made = shading(gain)
    before = error(made, np.ones_like(gain), gain)
    after = error(made, estimate_gains(made).gain, gain)
    assert (after[before > 0.05] < 0.4 * before[before > 0.05]).all()
    assert (after[before <= 0.05] < 0.05).all()


def test_where_windows_show_the_sky_nothing_changes() -> None:
    gain = np.where(NODE[:, 1:2] > 0.42, 4.0, 1.0) * np.ones(3)
    found = estimate_gains(shading(gain)).gain
    shown = (NODE @ AHEAD > 0.9) & (np.abs(NODE[:, 1]) < 0.3)
    np.testing.assert_allclose(found[shown], 1.0, atol=0.3)
    away = NODE @ AHEAD < -0.9
    # No point is lit from behind: only the prior's correlation reaches there.
    assert np.abs(np.log(found[away])).max() < np.abs(np.log(found)).max()


def test_no_surface_reflects_more_than_it_receives() -> None:
    """All points are lit alike, so that shading tells nothing, but the energy does."""
    made = shading(np.ones((len(NODE), 3)), noise=0.0)
    same = np.broadcast_to(made.unseen.mean(axis=0), made.unseen.shape)
    known = np.broadcast_to(made.known.mean(axis=0), made.known.shape)
    received = known + same.sum(axis=1)
    bright = Shading(3.0 / np.pi * received, made.segment, known, same, SHOWN)
    dull = Shading(0.6 / np.pi * received, made.segment, known, same, SHOWN)
    lit = known + (same * estimate_gains(bright).gain).sum(axis=1)
    assert (np.pi * bright.radiance / lit).max() < 1.5
    np.testing.assert_allclose(estimate_gains(dull).gain, 1.0, atol=0.02)


def test_few_points_leave_more_doubt() -> None:
    gain = np.where(NODE[:, 1:2] > 0.42, 4.0, 1.0) * np.ones(3)
    many = shading(gain)
    chosen = np.arange(0, 300, 7)
    few = Shading(
        many.radiance[chosen],
        many.segment[chosen],
        many.known[chosen],
        many.unseen[chosen],
        SHOWN,
    )
    sure, unsure = (estimate_gains(made) for made in (many, few))
    assert sure.spread == unsure.spread
    assert (sure.deviation > 0.0).all()
    assert (1.05 * sure.deviation < unsure.deviation).all()
    assert (unsure.deviation < unsure.spread + 0.6).all()


def test_nodes_are_in_circles() -> None:
    assert len(NODE) % AZIMUTHS == 0
    np.testing.assert_allclose(np.linalg.norm(NODE, axis=-1), 1.0)
