"""The brute-force reference where the answer is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.footage.sun import Sun
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, Mesh
from scenes360.modelling import sphere
from tests.footage.sunny_rooms import SKY, SunnyRoom
from tests.oracles.worlds import cosine_about
from tests.truth.conftest import sphere_frame

pytestmark = pytest.mark.mitsuba

ROOM = SunnyRoom(np.array([0.8, 0.55, 0.1]) / np.linalg.norm([0.8, 0.55, 0.1]))


def ball(material: Material, centre: tuple[float, float, float], radius: float) -> Instance:
    solid = sphere(1.0, segments=96)
    mesh = Mesh(
        solid.positions.astype(np.float32),
        solid.normals.astype(np.float32),
        solid.uvs.astype(np.float32),
        solid.triangles.astype(np.int32),
        np.zeros(len(solid.triangles), np.int32),
        (material,),
    )
    to_world = np.diag([radius, radius, radius, 1.0])
    to_world[:3, 3] = centre
    return Instance("ball", mesh, to_world)


def shot(frame: Frame, objects: list[Instance], view: View, spp: int, clean: bool = False) -> Any:
    from iprt.truth.panorama import load_world, render_reference  # starts Mitsuba

    return render_reference(load_world(frame, objects), view, spp=spp, clean=clean)


@pytest.mark.parametrize(
    ("material", "expected", "tolerance"),
    [
        (Material("diffuse", (0.8, 0.5, 0.2)), (0.8, 0.5, 0.2), 0.01),
        (Material("conductor", (0.9, 0.6, 0.3), alpha=0.0), (0.9, 0.6, 0.3), 0.01),
        # One scattering between microfacets only: a little is lost.
        (Material("conductor", (0.9, 0.6, 0.3), alpha=0.05), (0.9, 0.6, 0.3), 0.015),
        (Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0), (1.0, 1.0, 1.0), 0.01),
    ],
    ids=["diffuse", "mirror", "rough conductor", "glass"],
)
def test_furnace(
    mi: Any, material: Material, expected: tuple[float, float, float], tolerance: float
) -> None:
    """In constant light an object shows its reflectance times the light."""
    # A far wall, so that the object's own shadow on it does not matter.
    frame = sphere_frame(np.full((32, 64, 3), 2.0, np.float32), 40.0)
    view = View(24, 24, fov_y_deg=30.0)
    result = shot(frame, [ball(material, (0.0, 0.0, -2.0), 0.4)], view, 64)
    inside = result.coverage == 1.0
    assert inside.sum() > 100
    mean = result.objects[inside].mean(axis=0)
    np.testing.assert_allclose(mean, 2.0 * np.array(expected), rtol=tolerance)
    outside = result.coverage == 0.0
    np.testing.assert_allclose(result.background[outside], 2.0, rtol=1e-5)


def test_a_lamp_shines_and_lights_the_wall(mi: Any) -> None:
    """Its map multiplies its radiance; the wall gets the closed form of a ball's irradiance."""
    half = np.full((2, 2, 3), 0.5, np.float32)
    lamp = Material(albedo=(0.0, 0.0, 0.0), emission=(60.0, 20.0, 8.0), emission_texture=half)
    centre, radius = np.array([0.0, 0.0, -2.0]), 0.2
    frame = sphere_frame(np.ones((32, 64, 3), np.float32), 3.0)
    view = View(48, 48, fov_y_deg=60.0)
    result = shot(frame, [ball(lamp, tuple(centre), radius)], view, 256)
    inside, beside = result.coverage == 1.0, result.coverage == 0.0
    assert inside.sum() > 30
    np.testing.assert_allclose(result.objects[inside].mean(axis=0), (30.0, 10.0, 4.0), rtol=1e-3)
    d = view.directions()[beside]
    away = centre - 3.0 * d
    distance = np.linalg.norm(away, axis=-1)
    factor = (radius / distance) ** 2 * -(away * d).sum(-1) / distance
    added = (result.ratio[beside] - 1.0).mean(axis=0)
    np.testing.assert_allclose(added, np.array([29.0, 9.0, 3.0]) * factor.mean(), rtol=0.05)


def test_white_objects_that_shade_and_light_each_other_are_invisible(mi: Any) -> None:
    frame = sphere_frame(np.full((32, 64, 3), 0.7, np.float32), 3.0)
    white = Material("diffuse", (1.0, 1.0, 1.0))
    pair = [ball(white, (x, 0.0, -1.5), 0.4) for x in (-0.42, 0.42)]
    view = View(24, 16, fov_y_deg=40.0)
    result = shot(frame, pair, view, 256)
    between = result.color[7:9, 10:14]
    assert result.coverage[7:9, 10:14].mean() > 0.7
    # Paths end after BOUNCES surfaces, which few that start between the balls reach.
    assert between.mean() == pytest.approx(0.7, rel=0.03)
    assert result.color.mean() == pytest.approx(0.7, rel=0.005)


def shadow_of_black_ball(
    color: NDArray[np.float32], radius: float, centre: NDArray[np.float64], r: float, view: View
) -> NDArray[np.float64]:
    """E_RV / E_R inside a sphere, by summation over all texels.

    Between two points of a sphere's inside, cos cos / (pi distance^2) is constant: irradiance is
    the mean radiance of the sphere's area that is seen.
    """
    height, width = color.shape[:2]
    whole = View(width, height, projection="equirect")
    lights = radius * whole.directions().reshape(-1, 3)
    weight = np.repeat(np.sin((np.arange(height) + 0.5) / height * np.pi), width)
    light = (color[..., 0].ravel() * weight).astype(np.float64)
    ratio = []
    for point in radius * view.directions().reshape(-1, 3):
        d = lights - point
        length = np.linalg.norm(d, axis=-1)
        d /= np.maximum(length, 1e-9)[:, None]
        along = (d @ (centre - point)).clip(0.0, length)
        near = np.linalg.norm(point + along[:, None] * d - centre, axis=-1)
        ratio.append((light * (near > r)).sum() / light.sum())
    return np.array(ratio).reshape(view.height, view.width)


@pytest.mark.parametrize("lamp", [0.0, 60.0], ids=["constant light", "a lamp"])
def test_shadow_of_a_black_ball_is_the_blocked_light(mi: Any, lamp: float) -> None:
    color = np.full((64, 128, 3), 0.5, np.float32)
    color[8:13, 70:80] += lamp
    centre, r = np.array([0.5, -1.4, -0.6]), 0.4
    black = ball(Material("diffuse", (0.0, 0.0, 0.0)), tuple(centre), r)
    view = View(32, 16, projection="equirect")
    result = shot(sphere_frame(color, 2.5), [black], view, 512)
    expected = shadow_of_black_ball(color, 2.5, centre, r, view)
    seen = result.coverage == 0.0
    error = result.ratio[..., 0][seen] - expected[seen]
    assert expected[seen].min() < 0.9, "the case has a shadow"
    assert abs(error.mean()) < 0.002
    assert np.sqrt((error**2).mean()) < 0.02
    # A constant light has no edges: there each pixel agrees.
    if lamp == 0.0:
        assert np.abs(error).max() < 0.06


def test_openings_take_no_shadow_and_cast_light(mi: Any) -> None:
    frame = sphere_frame(np.full((32, 64, 3), 0.5, np.float32), 2.5)
    opening = np.zeros((32, 64), bool)
    opening[16:] = True
    black = ball(Material("diffuse", (0.0, 0.0, 0.0)), (0.0, -1.5, 0.0), 0.5)
    view = View(32, 16, projection="equirect")
    result = shot(replace(frame, opening=opening), [black], view, 32)
    assert (result.ratio[9:] == 1.0).all()
    assert result.ratio[6].min() < 1.0


def test_without_objects_the_panorama_is_shown(mi: Any) -> None:
    rng = np.random.default_rng(3)
    color = rng.uniform(0.1, 1.0, (16, 32, 3)).astype(np.float32)
    view = View(32, 16, projection="equirect")
    result = shot(sphere_frame(color, 2.0), [], view, 64, clean=True)
    assert (result.ratio == 1.0).all()
    assert not result.coverage.any()
    # Each pixel averages a bilinear interpolation: close to its texel, not equal.
    np.testing.assert_allclose(result.color.mean((0, 1)), color.mean((0, 1)), rtol=0.01)
    assert np.corrcoef(result.color.ravel(), color.ravel())[0, 1] > 0.9


def test_a_sun_lights_what_it_reaches_through_a_window(mi: Any) -> None:
    """Shadow, lit side and disc, each in closed form by other light that is measured without it."""
    room = ROOM
    plain = room.frame(256, 128)
    sunny = replace(plain, sun=Sun(room.sun, room.irradiance, angle_deg=4.0))
    radius, floor = 0.18, room.world.low[1]
    centre = np.array([0.9, floor + 2.0 * radius, -0.6])
    shade = centre - 2.0 * radius / room.sun[1] * room.sun
    up = np.array([0.0, 1.0, 0.0])
    gray = ball(Material("diffuse", (0.5, 0.5, 0.5)), tuple(centre.tolist()), radius)
    perfect = ball(Material("conductor", (1.0, 1.0, 1.0), 0.0), tuple(centre.tolist()), radius)

    def towards(point: NDArray[np.float64], fov: float) -> View:
        d = point / np.linalg.norm(point)
        yaw, pitch = np.degrees([np.arctan2(d[0], -d[2]), np.arcsin(d[1])])
        return View(16, 16, yaw_deg=float(yaw), pitch_deg=float(pitch), fov_y_deg=fov)

    def pictured(frame: Frame, thing: Instance, point: NDArray[np.float64], fov: float) -> Any:
        return shot(frame, [thing], towards(point, fov), 256)

    middle = (slice(7, 9), slice(7, 9))
    # Without objects, the sun adds its own irradiance; with them, none in their shadow.
    sun = room.sun @ up / np.pi * np.array(room.irradiance)
    with_it, without = (pictured(frame, gray, shade, 8.0).ratio[middle] for frame in (sunny, plain))
    gathered = measured_irradiance(shade + 1e-3 * up, up)
    expected = without.mean((0, 1)) * gathered / (gathered + sun)
    np.testing.assert_allclose(with_it.mean((0, 1)), expected, rtol=0.08)

    normal = np.array([0.1, 0.9, 0.4]) / np.linalg.norm([0.1, 0.9, 0.4])
    lit = centre + radius * normal
    bright, dark = (pictured(frame, gray, lit, 4.0).objects[middle] for frame in (sunny, plain))
    more = 0.5 * room.sun @ normal / np.pi * np.array(room.irradiance)
    np.testing.assert_allclose((bright - dark).mean((0, 1)), more, rtol=0.08)

    for _ in range(50):  # the normal that reflects the view into the sun, by fixed-point steps
        half = -(centre + radius * normal)
        half = half / np.linalg.norm(half) + room.sun
        normal = half / np.linalg.norm(half)
    spot = pictured(sunny, perfect, centre + radius * normal, 0.5).objects[middle].mean((0, 1))
    assert sunny.sun is not None
    np.testing.assert_allclose(spot, np.array(sunny.sun.radiance) + SKY, rtol=0.05)


def measured_irradiance(
    point: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(3,) irradiance / pi by all that the sunny room's panorama shows, by Monte Carlo."""
    d = cosine_about(np.broadcast_to(normal, (100_000, 3)), np.random.default_rng(0))
    t, facing, _ = ROOM.world.first_hit(point, d)
    return np.asarray(ROOM.radiance(point + t[:, None] * d, facing).mean(axis=0))
