"""The sky behind the windows of path-traced rooms, beside the one that they were rendered with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from iprt.footage.cells import Geometry
from iprt.footage.found_sky.search import find_sky
from iprt.footage.found_sky.shading import Shading
from iprt.footage.frame import Frame
from iprt.footage.received_light import RoomLight
from iprt.footage.sky import AZIMUTHS, ELEVATIONS_DEG, OUTSIDE_ROWS
from iprt.footage.window_environment import outside_radiance, seen_share
from iprt.scene.scene import Scene
from scenes360 import textures
from scenes360.room.plan import SEED, SUN

SCENES = Path(__file__).parents[3] / "scenes360"


@pytest.fixture(scope="module")
def room() -> Frame:
    return Scene.open(SCENES / "room").frame(0).recolored(sky=None)


def surfaces(frame: Frame) -> RoomLight:
    return RoomLight.of(frame, Geometry.of(frame, 256))


def test_the_hue_of_a_path_traced_rooms_sky_is_found(room: Frame) -> None:
    """Its zenith is bluer than the horizon in the windows, which is extrapolated."""
    assert room.sun is not None
    sky = find_sky(room, surfaces(room), room.sun.direction)
    assert sky is not None
    truth = textures.sky(1024, sun=SUN, sun_radiance=(0.0, 0.0, 0.0), sun_radius_deg=0.8, seed=SEED)
    truth = truth.reshape(OUTSIDE_ROWS, 4, 2 * OUTSIDE_ROWS, 4, 3).mean(axis=(1, 3))
    light = room.radiance[room.opening]
    # Above the horizon, on the side of the windows (-x), where they show nothing.
    unseen = seen_share(room.opening) == 0.0
    rows, columns = slice(OUTSIDE_ROWS // 6, OUTSIDE_ROWS // 2 - 14), slice(32, 96)
    above = np.zeros_like(unseen)
    above[rows, columns] = unseen[rows, columns]

    def tint(environment: np.ndarray) -> np.ndarray:
        red, green, blue = environment[above].mean(axis=0)
        return np.log([red / green, blue / green])

    plain, found = (
        np.abs(tint(outside_radiance(light, room.opening, one)) - tint(truth))
        for one in (None, sky)
    )
    assert plain.max() > 0.15
    assert found.max() < 0.6 * plain.max()


def test_shading_is_an_integral_of_the_environment(room: Frame) -> None:
    """No part is negative, and the ground straight below lights next to nothing."""
    made = Shading.of(room, surfaces(room), None)
    assert made is not None
    assert (made.unseen >= 0.0).all()
    assert (made.known > 0.0).all()
    below = made.unseen[:, :12].sum() / made.unseen.sum()
    assert below < 0.05


def test_nodes_stay_in_the_world_when_the_camera_turns(room: Frame) -> None:
    """The pose takes the middle of the picture to -X, three nodes to the left."""
    still = Shading.of(room, surfaces(room), None)
    pose = np.eye(4)
    pose[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    turned = Shading.of(room.recolored(pose=pose), surfaces(room), None)
    assert still is not None
    assert turned is not None
    here, there = (
        made.unseen.reshape(-1, len(ELEVATIONS_DEG), AZIMUTHS, 3) for made in (still, turned)
    )
    np.testing.assert_allclose(np.roll(there, 3, axis=2), here, atol=1e-9)
    np.testing.assert_allclose(turned.shown, still.shown @ pose[:3, :3].T, atol=1e-12)


def test_there_is_none_without_windows(room: Frame) -> None:
    closed = room.recolored(opening=np.zeros_like(room.opening))
    assert find_sky(closed, surfaces(closed), None) is None
