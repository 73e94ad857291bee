"""Plane fits: exact on planes, nothing across edges, truth out of noise."""

from __future__ import annotations

import numpy as np
import pytest

from iprt.capture.depth_normals import fit_planes
from iprt.capture.pinhole import Pinhole

RAYS = Pinhole(60.0, 60.0, 39.5, 29.5, 80, 60).rays()


def of_plane(normal: np.ndarray, distance: float) -> np.ndarray:
    return (-distance / (RAYS @ normal)).astype(np.float32)


@pytest.mark.parametrize("tilt", [[0, 0, -1], [0.6, 0, -0.8], [0, -0.8, -0.6], [0.5, 0.5, -0.7]])
def test_planes_are_found(tilt: list[float]) -> None:
    normal = np.array(tilt) / np.linalg.norm(tilt)
    depth = of_plane(normal, 1.0)
    depth[(depth < 0.0) | (depth > 3.0)] = 0.0
    refined, found = fit_planes(depth, RAYS)
    there = refined > 0.0
    assert there.mean() > 0.4
    assert np.abs(refined - depth)[there].max() < 1e-4
    assert (found[there] @ normal).min() > 1.0 - 1e-5
    assert not found[~there].any()


def test_noise_is_smoothed() -> None:
    random = np.random.default_rng(0)
    normal = np.array([0.3, 0.1, -0.95]) / np.linalg.norm([0.3, 0.1, -0.95])
    depth = of_plane(normal, 2.0)
    noise = (0.01 * random.standard_normal(depth.shape)).astype(np.float32)
    refined, found = fit_planes(depth + noise, RAYS)
    there = refined > 0.0
    assert there.mean() > 0.9
    # Of 25 neighbours: a fifth of the noise, and a little more at the picture's edges.
    assert np.std((refined - depth)[there]) < 0.3 * 0.01
    assert np.median(found[there] @ normal) > 0.99


def test_edges_and_lone_pixels_have_no_plane_in_between() -> None:
    depth = np.full((60, 80), 2.0, np.float32)
    depth[:, 40:] = 1.0
    depth[30, 60] = 1.5
    refined, _ = fit_planes(depth, RAYS)
    assert refined[30, 60] == 0.0
    found = refined[refined > 0.0]
    assert np.minimum(np.abs(found - 1.0), np.abs(found - 2.0)).max() < 1e-5
    assert not fit_planes(np.zeros((60, 80), np.float32), RAYS)[0].any()
