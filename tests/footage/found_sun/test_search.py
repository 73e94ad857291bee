"""A sun that the panorama does not show, found by the patches that it lights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.cell_rays import leaves
from iprt.footage.cells import Cells, Geometry
from iprt.footage.found_light import find_light
from iprt.footage.found_sun.local_mean import LocalMean
from iprt.footage.found_sun.search import upper_hemisphere
from iprt.footage.frame import LUMINANCE, Frame
from iprt.footage.sun import Sun
from iprt.geometry.camera import View
from iprt.geometry.equirect import solid_angles
from iprt.scene.scene import Scene
from scenes360 import textures
from scenes360.room.plan import SUN
from scenes360.yard import model as yard_model
from tests.footage.sunny_rooms import SunnyRoom
from tests.footage.sunny_yards import SunnyYard

Float = NDArray[np.float64]

WIDTH, HEIGHT = 512, 256
SCENES = Path(__file__).parents[3] / "scenes360"


def find_sun(frame: Frame, *, sky: bool = False) -> Sun | None:
    return find_light(frame, "auto", sky=sky).sun


def unit(*v: float) -> Float:
    return np.asarray(v) / np.linalg.norm(v)


@pytest.mark.parametrize(
    "sun",
    [
        pytest.param(unit(0.8, 0.5, 0.1), marks=pytest.mark.thorough),
        unit(0.6, 0.5, -0.4),
        pytest.param(unit(0.5, 0.7, 0.3), marks=pytest.mark.thorough),
    ],
)
def test_a_sun_is_found(sun: Float) -> None:
    room = SunnyRoom(sun)
    found = find_sun(room.frame(WIDTH, HEIGHT))
    assert found is not None
    assert np.rad2deg(np.arccos(min(found.direction @ sun, 1.0))) < 2.0
    # The room's other light does not follow from its walls, so that only the color can be compared.
    color = np.array(found.irradiance) / sum(found.irradiance)
    np.testing.assert_allclose(color, np.array(room.irradiance) / sum(room.irradiance), atol=0.02)


def test_the_sun_of_a_path_traced_room_is_found() -> None:
    """Mitsuba rendered it; direction, and irradiance by the environment's pixels."""
    frame = Scene.open(SCENES / "train").frame(0)
    found = find_sun(frame.recolored(sun=None, sky=None), sky=True)
    assert found is not None
    truth = unit(*SUN)
    assert np.rad2deg(np.arccos(min(found.direction @ truth, 1.0))) < 2.0
    sky = [
        textures.sky(1024, sun=SUN, sun_radiance=color, sun_radius_deg=0.8, seed=0)
        for color in ((30000.0, 27200.0, 23000.0), (0.0, 0.0, 0.0))
    ]
    irradiance = np.einsum("yxc,y->c", sky[0] - sky[1], solid_angles(1024, 512))
    np.testing.assert_allclose(LUMINANCE @ found.irradiance, LUMINANCE @ irradiance, rtol=0.2)
    np.testing.assert_allclose(found.irradiance, irradiance, rtol=0.3)


HIDDEN = unit(-0.8, 0.5, 0.05)
"""Behind the yard's pillar."""


@pytest.mark.thorough
def test_a_sun_behind_a_pillar_is_found() -> None:
    """Rays that pass behind the pillar, as seen from the capture centre, still leave to the sky."""
    yard = SunnyYard(HIDDEN)
    assert not yard.sunlit(np.zeros(3))
    found = find_sun(yard.frame(WIDTH, HEIGHT))
    assert found is not None
    assert np.rad2deg(np.arccos(min(found.direction @ HIDDEN, 1.0))) < 2.0


def test_a_sun_in_sight_is_found() -> None:
    """By its disc, which does not count as other light, whether it is clipped or not."""
    sun = unit(0.55, 0.75, 0.2)
    frame = SunnyYard(sun).frame(WIDTH, HEIGHT)
    cosine = View(WIDTH, HEIGHT, projection="equirect").directions() @ sun
    irradiance = []
    for radius, radiance in ((1.0, 3000.0), (4.0, 3.0)):
        disc = (cosine > np.cos(np.deg2rad(radius)))[..., None]
        found = find_sun(replace(frame, color=np.where(disc, np.float32(radiance), frame.color)))
        assert found is not None
        assert np.rad2deg(np.arccos(min(found.direction @ sun, 1.0))) < 0.4
        irradiance.append(found.irradiance)
    # A disc that counted as other light too would double it.
    np.testing.assert_allclose(*irradiance, rtol=0.15)


def test_a_bright_spot_that_lights_nothing_is_no_sun() -> None:
    frame = SunnyYard(HIDDEN, irradiance=(0.0, 0.0, 0.0)).frame(WIDTH, HEIGHT)
    d = View(WIDTH, HEIGHT, projection="equirect").directions()
    spot = d @ unit(0.55, 0.75, 0.2) > np.cos(np.deg2rad(1.0))
    color = np.where(spot[..., None], np.float32(3.0), frame.color)
    assert find_sun(replace(frame, color=color)) is None


@pytest.mark.thorough
def test_the_irradiance_of_a_path_traced_yard_is_found() -> None:
    frame = Scene.open(SCENES / "yard").frame(0)
    found = find_sun(replace(frame, sun=None))
    assert found is not None
    truth = unit(*yard_model.SUN)
    assert np.rad2deg(np.arccos(min(found.direction @ truth, 1.0))) < 1.0
    np.testing.assert_allclose(found.irradiance, yard_model.IRRADIANCE, rtol=0.2)


def test_there_is_none_without_one() -> None:
    room = SunnyRoom(unit(0.8, 0.5, 0.1), irradiance=(0.0, 0.0, 0.0))
    assert find_sun(room.frame(WIDTH, HEIGHT)) is None


def test_nor_in_a_closed_room() -> None:
    room = SunnyRoom(unit(0.8, 0.5, 0.1), panes=())
    assert find_sun(room.frame(WIDTH, HEIGHT)) is None


def test_rays_leave_through_windows() -> None:
    """As lines through the rectangles do; cells at their edges aside."""
    room = SunnyRoom(unit(0.8, 0.5, 0.1))
    frame = room.frame(WIDTH, HEIGHT)
    cells = Cells.of(Geometry.of(frame, 128), 128)
    below = np.flatnonzero(cells.normal[:, 1] > 0.95)
    start = cells.point[below] + 0.01 * cells.normal[below]
    found = leaves(cells, start, np.broadcast_to(room.sun, start.shape), 100)
    inside = room.sunlit(start)
    near = np.array([[dx, 0.0, dz] for dx in (-0.08, 0.08) for dz in (-0.08, 0.08)])
    edge = np.any([room.sunlit(start + step) != inside for step in near], axis=0)
    assert 0.2 < inside.mean() < 0.8
    assert (found == inside)[~edge].mean() > 0.995


def test_means_are_sums_over_the_sphere() -> None:
    """Brute force, at the seam and the poles too."""
    rows, width = 16, 0.3
    rng = np.random.default_rng(0)
    values, weights = rng.random((2, 2 * rows**2, 2)).astype(np.float32)
    d = View(2 * rows, rows, projection="equirect").directions().reshape(-1, 3)
    near = np.exp((d @ d.T - 1.0) / width**2)
    mean = LocalMean(rows, width)
    expected = near @ (weights * values) / (near @ weights)
    np.testing.assert_allclose(mean(values, weights), expected, rtol=2e-4)


def test_directions_cover_the_upper_hemisphere() -> None:
    d = upper_hemisphere(350)
    np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 1.0, rtol=1e-12)
    assert (d[:, 1] > 0.0).all()
    others = View(64, 32, projection="equirect").directions()[:16].reshape(-1, 3)
    assert np.rad2deg(np.arccos((others @ d.T).max(axis=1))).max() < 7.7
