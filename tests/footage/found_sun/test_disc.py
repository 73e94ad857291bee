"""A sun's disc in the picture: found, and not counted twice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.clipped_texels import ClippedTexels
from iprt.footage.found_sun.disc import visible_disc, without_disc
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import solid_angles
from tests.footage.sunny_yards import SKY, SunnyYard

Float = NDArray[np.float64]

WIDTH, HEIGHT = 512, 256
DIRECTIONS = View(WIDTH, HEIGHT, projection="equirect").directions()
PLACES = [(0.55, 0.75, 0.2), (0.01, 0.4, 0.9), (0.02, 1.0, 0.01)]
"""In open sky, beside the seam, and near the zenith."""


def unit(*v: float) -> Float:
    return np.asarray(v) / np.linalg.norm(v)


def with_disc(yard: SunnyYard, radius_deg: float, radiance: float) -> tuple[Frame, Frame]:
    """The panorama without and with a disc of whole texels."""
    frame = yard.frame(WIDTH, HEIGHT)
    disc = np.isinf(frame.depth) & (DIRECTIONS @ yard.sun > np.cos(np.deg2rad(radius_deg)))
    return frame, replace(frame, color=np.where(disc[..., None], np.float32(radiance), frame.color))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(("radius", "radiance"), [(1.0, 3000.0), (4.0, 2.0 * SKY)])
def test_it_is_found(place: tuple[float, float, float], radius: float, radiance: float) -> None:
    """Bright and small, or clipped, with the lens's bloom."""
    sun = unit(*place)
    found = visible_disc(with_disc(SunnyYard(sun), radius, radiance)[1])
    assert found is not None
    assert np.rad2deg(np.arccos(min(found @ sun, 1.0))) < 0.4


def test_an_even_sky_has_none() -> None:
    assert visible_disc(SunnyYard(unit(0.55, 0.75, 0.2)).frame(WIDTH, HEIGHT)) is None


def test_two_bright_spots_are_none() -> None:
    """Which of them is the sun?"""
    yard = SunnyYard(unit(0.55, 0.75, 0.2))
    _, frame = with_disc(yard, 1.0, 3000.0)
    other = DIRECTIONS @ unit(0.3, 0.8, -0.6) > np.cos(np.deg2rad(1.0))
    color = np.where(other[..., None], np.float32(3000.0), frame.color)
    assert visible_disc(replace(frame, color=color)) is None


@pytest.mark.parametrize("place", PLACES)
def test_its_light_is_the_skys(place: tuple[float, float, float]) -> None:
    """The ground has the same irradiance as without a disc, and the picture stays."""
    yard = SunnyYard(unit(*place))
    plain, frame = with_disc(yard, 1.0, 3000.0)
    dimmed = without_disc(frame, yard.sun)
    np.testing.assert_array_equal(dimmed.picture, frame.color)
    weight = solid_angles(WIDTH, HEIGHT)[:, None] * np.maximum(DIRECTIONS[..., 1], 0.0)
    light = [np.einsum("yxc,yx->c", one.radiance, weight) for one in (plain, frame, dimmed)]
    assert (light[1] > 1.2 * light[0]).all()
    np.testing.assert_allclose(light[2], light[0], rtol=1e-5)


def test_clipped_colors_stay_in_the_picture() -> None:
    """Of texels that were recovered before, beside and in the disc."""
    yard = SunnyYard(unit(0.55, 0.75, 0.2))
    _, frame = with_disc(yard, 1.0, 3000.0)
    bright = np.flatnonzero(frame.color[..., 0].ravel() > SKY)
    beside = np.array([WIDTH * (HEIGHT - 1) + 3])
    texel = np.concatenate([bright[::2], beside]).astype(np.int32)
    stored = np.full((len(texel), 3), 1.0, np.float32)
    frame = frame.recolored(clipped=ClippedTexels(texel, stored))
    shown = without_disc(frame, yard.sun).picture.reshape(-1, 3)
    expected = frame.color.reshape(-1, 3).copy()
    expected[texel] = 1.0
    np.testing.assert_array_equal(shown, expected)


def test_an_uneven_sky_without_a_disc_stays() -> None:
    """As in a window beside a sun that its frame hides."""
    yard = SunnyYard(unit(0.55, 0.75, 0.2))
    frame = yard.frame(WIDTH, HEIGHT)
    shade = 1.0 + 0.2 * np.sin(20.0 * DIRECTIONS).prod(axis=-1, keepdims=True)
    uneven = replace(frame, color=(frame.color * shade).astype(np.float32))
    assert without_disc(uneven, yard.sun) is uneven


def test_a_hidden_one_changes_nothing() -> None:
    """Behind the pillar."""
    yard = SunnyYard(unit(-0.8, 0.3, 0.0))
    frame = yard.frame(WIDTH, HEIGHT)
    assert without_disc(frame, yard.sun) is frame
