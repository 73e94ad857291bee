"""Depth with noise goes to the surfaces that it is scattered about, and to no others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from iprt.footage.prepare.denoise import smoothed
from iprt.geometry.camera import View
from iprt.geometry.meshes import load_mesh
from iprt.scene.mesh_pose import MeshPose
from iprt.scene.placement import RealSurfaces, set_down
from tests.oracles.worlds import Box, World

MESH = Path(__file__).parents[3] / "scenes360" / "room" / "meshes" / "pot.ply"
WIDTH, HEIGHT = 512, 256
ROOM = World()
TABLE = World(solids=(Box((0.2, -1.0, -1.5), (0.6, 0.4, 0.3), 0.3),))
Picture = NDArray[np.float32]


def depth_of(world: World) -> tuple[Picture, NDArray[np.intp]]:
    """Exact depth, and the number of the solid that is seen; 0 for walls."""
    directions = View(WIDTH, HEIGHT, projection="equirect").directions()
    distance, _, which = world.first_hit(np.zeros(3), directions)
    return distance.astype(np.float32), which


def noisy(depth: Picture, noise: float, seed: int = 0) -> Picture:
    """White noise, relative to depth."""
    values = np.random.default_rng(seed).normal(size=depth.shape)
    return np.asarray(depth * (1.0 + noise * values), np.float32)


def errors(depth: Picture, truth: Picture) -> Picture:
    return np.asarray(np.abs(depth / truth - 1.0), np.float32)


@pytest.mark.parametrize("world", [ROOM, TABLE], ids=["room", "table"])
def test_exact_depth_stays_as_it_is(world: World) -> None:
    depth, _ = depth_of(world)
    assert smoothed(depth) is depth
    # So does depth in millimetres.
    rounded = np.asarray(np.rint(depth * 1e3) / 1e3, np.float32)
    assert errors(smoothed(rounded), rounded).max() < 5e-4


@pytest.mark.thorough
@pytest.mark.parametrize("noise", [0.002, 0.005, 0.01, 0.02])
def test_walls_are_where_they_were_without_noise(noise: float) -> None:
    depth, _ = depth_of(ROOM)
    found = errors(smoothed(noisy(depth, noise)), depth)
    assert np.median(found) < 0.05 * noise
    assert np.quantile(found, 0.99) < noise


def test_errors_that_many_texels_share_become_smaller() -> None:
    """Of depth that is noisy; smooth errors alone cannot be told from curved walls."""
    depth, _ = depth_of(ROOM)
    shared = gaussian_filter(np.random.default_rng(1).normal(size=depth.shape), 8, mode="wrap")
    wrong = noisy(np.asarray(depth * (1.0 + 0.005 * shared / shared.std()), np.float32), 0.003)
    before, after = errors(wrong, depth), errors(smoothed(wrong), depth)
    assert np.sqrt((after**2).mean()) < 0.5 * np.sqrt((before**2).mean())


def test_steps_stay() -> None:
    """A table and what is behind it keep their depth up to the edge."""
    depth, which = depth_of(TABLE)
    noise = 0.005
    found = errors(smoothed(noisy(depth, noise)), depth)
    across = np.abs(np.log(depth[:, 1:] / depth[:, :-1])) > 0.1
    beside = np.zeros(depth.shape, bool)
    beside[:, 1:] |= across
    beside[:, :-1] |= across
    assert beside.sum() > 100
    # As far off as before at most, where the step is a hundred times as high.
    assert np.quantile(found[beside], 0.95) < 2.0 * noise
    assert np.median(found[which == 1]) < 0.5 * noise


def test_what_has_no_depth_keeps_none() -> None:
    depth, _ = depth_of(ROOM)
    holes = noisy(depth, 0.01)
    for value, column in ((0.0, 100), (np.nan, 200), (np.inf, 300), (-1.0, 400)):
        holes[100:120, column : column + 20] = value
    none = ~((holes > 0.0) & (holes < np.inf))
    np.testing.assert_array_equal(smoothed(holes)[none], holes[none])
    assert np.median(errors(smoothed(holes)[~none], depth[~none])) < 1e-3


def test_a_turned_panorama_is_turned() -> None:
    depth = noisy(depth_of(TABLE)[0], 0.01)
    turned = np.roll(smoothed(np.roll(depth, 64, axis=1)), -64, axis=1)
    np.testing.assert_allclose(turned, smoothed(depth), rtol=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("pitch_deg", [-69.0, -44.0, -24.0])
def test_objects_set_down_on_noisy_depth_stand_on_the_floor(pitch_deg: float) -> None:
    """At three distances, from 1.5 to 3.5 m; without smoothing they are some 10 mm off."""
    mesh = load_mesh(MESH)
    frame = ROOM.frame(WIDTH, HEIGHT)
    for noise in (0.0, 0.005, 0.01):
        depth = smoothed(noisy(frame.depth, noise))
        surfaces = RealSurfaces(replace(frame, depth=depth, normal=None))
        placed = set_down(surfaces, mesh, 30.0, pitch_deg, MeshPose()).to_world
        assert placed[1, 3] + mesh.positions[:, 1].min() == pytest.approx(ROOM.low[1], abs=1e-3)
