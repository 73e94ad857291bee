"""Light that surfaces receive, in rooms where it is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.footage.cells import Geometry, cell_means
from iprt.footage.diffuse_share import diffuse_share
from iprt.footage.frame import Frame
from iprt.footage.received_light import ReceivedLight, RoomLight, cosine_directions
from iprt.footage.sky import OUTSIDE_ROWS
from iprt.geometry.coat import fresnel_dielectric
from iprt.geometry.equirect import equirect_direction
from iprt.geometry.material import Material
from tests.footage.sunny_rooms import SunnyRoom
from tests.oracles.worlds import Box, World
from tests.worlds import sphere_frame

POINTS = np.array([[0.3, -1.4, -0.5], [1.5, -1.4, 0.4], [-2.0, 0.1, 0.3], [0.5, 0.2, -2.5]])
NORMALS = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def received(frame: Frame) -> ReceivedLight:
    return RoomLight.of(frame, Geometry.of(frame, 256)).received(POINTS, NORMALS)


def test_directions_have_the_density_of_the_cosine() -> None:
    """Their mean is 2/3 of the normal, and all are on its side."""
    d = cosine_directions(NORMALS, 4096, np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 1.0, rtol=1e-12)
    assert (np.einsum("ijk,ik->ij", d, NORMALS) > 0.0).all()
    np.testing.assert_allclose(d.mean(axis=1), 2.0 / 3.0 * NORMALS, atol=2e-3)


def test_a_closed_white_room_gives_pi() -> None:
    light = received(World().frame(512, 256))
    np.testing.assert_allclose(light.irradiance(None), np.pi, rtol=1e-6)


def test_walls_and_windows_share_the_hemisphere() -> None:
    """The projected solid angle of panes is theirs by brute force, in the direction of each."""
    room = SunnyRoom(np.array([0.8, 0.6, 0.0]))
    frame = room.frame(1024, 512)
    light = received(replace(frame, color=np.ones_like(frame.color)))
    seen = light.windows.sum(axis=1)
    d = cosine_directions(NORMALS, 1 << 16, np.random.default_rng(1))
    start = POINTS + 1e-6 * NORMALS
    hit, _, _ = room.world.first_hit(start[:, None], d)
    ends = start[:, None] + hit[..., None] * d
    through = room._at_window(ends)
    expected = np.pi * through.mean(axis=1)
    np.testing.assert_allclose(seen, expected, rtol=0.06, atol=0.01)
    np.testing.assert_allclose(light.rest[:, 0] + seen, np.pi, rtol=0.04)
    # An environment that grows with height tells where the rays go.
    pixels = np.stack(np.meshgrid(np.arange(2 * OUTSIDE_ROWS), np.arange(OUTSIDE_ROWS)), axis=-1)
    up = equirect_direction(pixels + 0.5, 2 * OUTSIDE_ROWS, OUTSIDE_ROWS)[..., 1] + 1.0
    found = light.irradiance(np.repeat(up[..., None], 3, axis=-1)) - light.rest
    truth = np.pi * (through * (d[..., 1] + 1.0)).mean(axis=1)
    np.testing.assert_allclose(found[:, 0], truth, rtol=0.06, atol=0.01)


def test_a_box_takes_the_light_of_what_it_hides() -> None:
    """Dark, in a white room, beside the second point."""
    world = World(solids=(Box((1.9, -0.9, 0.4), (0.1, 0.5, 0.6)),))
    frame = world.frame(1024, 512)
    towards = equirect_direction(
        np.stack(np.meshgrid(np.arange(1024), np.arange(512)), axis=-1) + 0.5, 1024, 512
    )
    _, _, which = world.first_hit(np.zeros(3), towards)
    color = np.where((which == 0)[..., None], np.float32(1.0), np.float32(0.0))
    found = received(replace(frame, color=color)).irradiance(None)[:, 0]
    d = cosine_directions(NORMALS, 1 << 16, np.random.default_rng(1))
    _, _, hit = world.first_hit((POINTS + 1e-6 * NORMALS)[:, None], d)
    expected = np.pi * (hit == 0).mean(axis=1)
    assert expected[1] < 0.85 * np.pi
    np.testing.assert_allclose(found, expected, rtol=0.04)


@pytest.mark.parametrize("alpha", [0.02, 0.1])
def test_a_coat_in_uniform_light_reflects_its_fresnel_term(alpha: float) -> None:
    """The coat of a floor in a white room reflects F of the angle of view."""
    frame = World().frame(512, 256)
    assert frame.normal is not None
    floor = frame.normal[..., 1] > 0.9
    coated = replace(
        frame,
        gloss=floor.view(np.uint8),
        real_materials=(Material("plastic", (0.5, 0.5, 0.5), alpha=alpha),),
    )
    share = diffuse_share(coated, Geometry.of(coated, 256))
    rows = len(share)
    pixels = np.stack(np.meshgrid(np.arange(2 * rows), np.arange(rows)), axis=-1) + 0.5
    down = -equirect_direction(pixels, 2 * rows, rows)[..., 1]
    inside = (down > 0.5) & (cell_means(floor, rows) == 1.0)
    expected = 1.0 - fresnel_dielectric(down[inside], 1.5)
    np.testing.assert_allclose(share[inside].mean(axis=-1), expected, atol=0.02)
    assert (share[down < 0.0] == 1.0).all()


def test_nothing_is_coated_without_gloss() -> None:
    frame = sphere_frame(2.0, 128, 64, 1.0)
    assert (diffuse_share(frame, Geometry.of(frame, 64)) == 1.0).all()
