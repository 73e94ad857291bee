"""Skies: factors on the light behind windows, where no camera saw it."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.footage.sky import (
    AZIMUTHS,
    ELEVATIONS_DEG,
    OUTSIDE_ROWS,
    Sky,
    node_directions,
    node_weights,
)
from iprt.footage.window_environment import outside_radiance, seen_share
from iprt.geometry.camera import View
from tests.footage.test_window_environment import COLUMNS, ROWS, random_colors, window, windows

NODES = len(ELEVATIONS_DEG) * AZIMUTHS


def random_gain() -> np.ndarray:
    return np.random.default_rng(5).uniform(0.2, 4.0, (NODES, 3))


def test_weights_interpolate() -> None:
    """A weight is 1 in its node's direction; none is negative, and all sum up to 1."""
    np.testing.assert_allclose(node_weights(node_directions()).toarray(), np.eye(NODES), atol=1e-9)
    d = View(96, 48, projection="equirect").directions().reshape(-1, 3)
    weights = node_weights(d).toarray()
    assert (weights >= 0.0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)


def test_factors_have_no_seam() -> None:
    factors = Sky(random_gain(), np.zeros(3)).factors
    inside = np.abs(np.diff(factors, axis=1)).max(axis=(1, 2))
    across = np.abs(factors[:, 0] - factors[:, -1]).max(axis=1)
    assert (across <= inside * 1.01).all()


def test_a_turned_camera_sees_the_same_sky() -> None:
    """A quarter turn to the left brings ahead the directions on the left."""
    gain, pose = random_gain(), np.eye(4)
    pose[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    sky = Sky(gain, np.zeros(3))
    turned = sky.seen_from(pose).factors
    expected = np.roll(sky.factors, OUTSIDE_ROWS // 2, axis=1)
    np.testing.assert_allclose(turned, expected, rtol=1e-5)


@windows
def test_what_windows_show_is_not_scaled(opening: np.ndarray) -> None:
    color = random_colors()
    plain = outside_radiance(color[opening], opening)
    sky = Sky(random_gain(), np.zeros(3))
    scaled = outside_radiance(color[opening], opening, sky)
    np.testing.assert_array_equal(scaled[opening], plain[opening])
    expected = (plain * sky.factors)[~opening]
    np.testing.assert_allclose(scaled[~opening], expected, rtol=1e-6)


@pytest.mark.parametrize("scale", [1, 2, 3])
def test_shares_are_of_the_texels(scale: int) -> None:
    opening = window(20, 60, 50, 20, scale)
    opening[:, 1::2] = False
    share = seen_share(opening)
    assert share.shape == (ROWS, COLUMNS)
    blocks = opening.reshape(ROWS, scale, COLUMNS, scale).mean(axis=(1, 3))
    np.testing.assert_allclose(share, blocks)


def test_the_mean_is_over_the_upper_hemisphere() -> None:
    """The mean of the gain 1 + 2 sin(elevation) is 2."""
    d = View(COLUMNS, ROWS, projection="equirect").directions()[: ROWS // 2]
    gain = np.repeat(1.0 + 2.0 * node_directions()[:, 1:2], 3, axis=1)
    np.testing.assert_allclose(Sky(gain, np.zeros(3)).mean, 2.0, rtol=0.02)
    factors = Sky(random_gain(), np.zeros(3)).factors[: ROWS // 2]
    weight = np.cos(np.arcsin(d[..., 1]))
    expected = np.average(factors, axis=(0, 1), weights=np.repeat(weight[..., None], 3, axis=-1))
    np.testing.assert_allclose(Sky(random_gain(), np.zeros(3)).mean, expected, rtol=0.01)
