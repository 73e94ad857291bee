"""A sun that the panorama does not show, against its closed form in an analytic room."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.footage.sun import Sun
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import Renderer
from iprt.scene.scene import Scene
from iprt.settings.model import Settings
from tests.footage.sunny_rooms import SunnyRoom
from tests.footage.sunny_yards import GROUND, SunnyYard
from tests.oracles.worlds import Sphere, cosine_about
from tests.rendering import render
from tests.trace.traced import settings
from tests.worlds import ball, disc

Float = NDArray[np.float64]

TOWARDS = np.array([0.8, 0.55, 0.1]) / np.linalg.norm([0.8, 0.55, 0.1])
ROOM = SunnyRoom(TOWARDS)
FLOOR = ROOM.world.low[1]
LIT = np.array([0.9, FLOOR, -0.6])
"""In the patch of the first pane."""
RADIUS = 0.18
ABOVE = np.array([0.0, 2.0 * RADIUS, 0.0])
RAW: dict[str, Any] = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}}


def sunny(frame: Frame) -> Frame:
    return replace(frame, sun=Sun(ROOM.sun, ROOM.irradiance))


@pytest.fixture(scope="module")
def frame() -> Frame:
    return ROOM.frame(512, 256)


def looking_at(point: Float, size: int = 64, fov: float = 40.0) -> View:
    d = point / np.linalg.norm(point)
    yaw, pitch = np.degrees([np.arctan2(d[0], -d[2]), np.arcsin(d[1])])
    return View(size, size, yaw_deg=float(yaw), pitch_deg=float(pitch), fov_y_deg=fov)


def room_light(point: Float, normal: Float, black: Sphere | None = None) -> Float:
    """(3,) irradiance / π by all but the sun, by Monte Carlo; a black ball may hide some of it."""
    d = cosine_about(np.broadcast_to(normal, (100_000, 3)), np.random.default_rng(3))
    t, facing, _ = ROOM.world.first_hit(point + 1e-6 * normal, d)
    light = ROOM.radiance(point + t[:, None] * d, facing)
    if black is not None:
        light[np.isfinite(black.interval(np.broadcast_to(point, d.shape), d)[0])] = 0.0
    return np.asarray(light.mean(axis=0))


def sunlight(normal: Float) -> Float:
    """(3,) irradiance / π by the whole disc."""
    return np.asarray(max(normal @ ROOM.sun, 0.0) / np.pi * np.array(ROOM.irradiance))


def object_at(point: Float, color: tuple[float, float, float]) -> tuple[Instance, Sphere]:
    centre = tuple((point + ABOVE).tolist())
    return ball(centre, RADIUS, Material(albedo=color)), Sphere(centre, RADIUS)


def mean_picture(device: ComputeDevice, frame: Frame, thing: Instance, view: View) -> Any:
    chosen = settings(rays=8, estimator="delta", **RAW)
    pictures = [
        render(device, frame, [thing], view, chosen.model_copy(update={"seed": seed}), frames=16)
        for seed in range(2)
    ]
    ratio = np.mean([picture.aovs["ratio"] for picture in pictures], axis=0)
    return np.mean([picture.color for picture in pictures], axis=0), ratio


def pixel(view: View, point: Float) -> tuple[slice, slice]:
    column, row = np.floor(view.project(point)).astype(int)
    return slice(row - 1, row + 2), slice(column - 1, column + 2)


def test_a_shadow_leaves_the_other_light(device: ComputeDevice, frame: Frame) -> None:
    """The sun's part of the irradiance is gone below a black ball, and nothing beside it."""
    assert ROOM.sunlit(LIT)
    thing, solid = object_at(LIT, (0.0, 0.0, 0.0))
    shade = np.asarray(solid.centre) - (solid.centre[1] - FLOOR) / ROOM.sun[1] * ROOM.sun
    beside = shade - np.array([0.0, 0.0, 0.4])
    assert ROOM.sunlit(shade)
    assert ROOM.sunlit(beside)
    view = looking_at(shade)
    up = np.array([0.0, 1.0, 0.0])
    _, ratio = mean_picture(device, sunny(frame), thing, view)
    expected = room_light(shade, up, solid) / (room_light(shade, up) + sunlight(up))
    shown = ratio[pixel(view, shade)].mean(axis=(0, 1))
    np.testing.assert_allclose(shown, expected, rtol=0.06)
    assert ratio[pixel(view, beside)].min() > 0.9


def test_the_picture_tells_the_shade(device: ComputeDevice) -> None:
    """A sun five degrees off shines where the picture has shade: no second shadow falls there.

    It is ten times as bright as all other light, as in real rooms.
    """
    strong = (60.0, 50.0, 40.0)
    frame = replace(ROOM, irradiance=strong).frame(512, 256)
    turn = np.deg2rad(5.0)
    wrong = ROOM.sun @ np.array(
        [[np.cos(turn), 0.0, np.sin(turn)], [0.0, 1.0, 0.0], [-np.sin(turn), 0.0, np.cos(turn)]]
    )
    # Where a sun in that direction would reach the floor, and the true one does not.
    x, z = np.meshgrid(np.linspace(-1.5, 2.0, 60), np.linspace(-2.2, 2.5, 80))
    floor = np.stack([x, np.full_like(x, FLOOR), z], axis=-1).reshape(-1, 3)
    near = np.array([[dx, 0.0, dz] for dx in (-0.06, 0.06) for dz in (-0.06, 0.06)])
    shade = replace(ROOM, sun=wrong).sunlit(floor) & ~ROOM.sunlit(floor)
    for step in near:
        shade &= replace(ROOM, sun=wrong).sunlit(floor + step) & ~ROOM.sunlit(floor + step)
    at = floor[shade][len(floor[shade]) // 2]
    thing = ball(
        tuple((at + 2.5 * RADIUS * wrong / wrong[1]).tolist()), RADIUS, Material(albedo=(0.0,) * 3)
    )
    view = looking_at(at)
    _, without = mean_picture(device, frame, thing, view)
    _, ratio = mean_picture(device, replace(frame, sun=Sun(wrong, strong)), thing, view)
    here = pixel(view, at)
    np.testing.assert_allclose(ratio[here].mean((0, 1)), without[here].mean((0, 1)), atol=0.05)


def test_a_ball_is_lit_by_it(device: ComputeDevice, frame: Frame) -> None:
    """Its point that faces the sun; without the sun it is as dark as the room makes it."""
    color = (0.6, 0.6, 0.6)
    thing, solid = object_at(LIT, color)
    normal = np.array([0.25, 0.9, 0.6])
    normal /= np.linalg.norm(normal)
    point = np.asarray(solid.centre) + RADIUS * normal
    view = looking_at(point, fov=12.0)
    others = room_light(point, normal)
    for shown, light in ((sunny(frame), others + sunlight(normal)), (frame, others)):
        picture, _ = mean_picture(device, shown, thing, view)
        found = picture[pixel(view, point)].mean(axis=(0, 1))
        np.testing.assert_allclose(found, np.array(color) * light, rtol=0.1)


def test_it_does_not_shine_through_walls(device: ComputeDevice, frame: Frame) -> None:
    """Off its patches, pictures are the same, but for noise."""
    at = np.array([-1.2, FLOOR, 1.5])
    thing, solid = object_at(at, (0.6, 0.6, 0.6))
    assert not ROOM.sunlit(np.asarray(solid.centre) + RADIUS * np.eye(3)).any()
    view = looking_at(at)
    with_it, _ = mean_picture(device, sunny(frame), thing, view)
    without, _ = mean_picture(device, frame, thing, view)
    np.testing.assert_allclose(with_it.mean(axis=(0, 1)), without.mean(axis=(0, 1)), rtol=0.01)


def test_it_is_found_by_chance_too(device: ComputeDevice, frame: Frame) -> None:
    """A mirror shows it: a wide sun, whose reflection is as bright as it is."""
    wide = Sun(ROOM.sun, ROOM.irradiance, angle_deg=10.0)
    centre = LIT + ABOVE
    mirror = Material("conductor", (1.0, 1.0, 1.0), alpha=0.0)
    thing = ball(tuple(centre.tolist()), RADIUS, mirror)
    # The normal that turns the view into the sun's direction, by a few fixed-point steps.
    normal = -centre / np.linalg.norm(centre)
    for _ in range(50):
        out = -(centre + RADIUS * normal)
        half = out / np.linalg.norm(out) + ROOM.sun
        normal = half / np.linalg.norm(half)
    view = looking_at(centre + RADIUS * normal, fov=3.0)
    picture, _ = mean_picture(device, replace(frame, sun=wide), thing, view)
    middle = picture[pixel(view, centre + RADIUS * normal)].mean(axis=(0, 1))
    np.testing.assert_allclose(middle, np.array(wide.radiance) + 3.0, rtol=0.05)


@pytest.mark.thorough
def test_no_speck_of_it_is_seen_in_glossy_surfaces(device: ComputeDevice) -> None:
    """Rays of a ball that the floor reflects would meet the sun once in 40 frames here."""
    frame = Scene.open(Path("scenes360/room")).frame()
    assert frame.sun is not None
    metal = Material("conductor", (0.95, 0.73, 0.38), alpha=0.05)
    thing = ball((0.08, -0.97, -1.4), 0.11, metal)
    view = View(144, 144, yaw_deg=3.3, pitch_deg=-34.7, fov_y_deg=11.5)
    for seed in (0, 2):
        chosen = Settings.model_validate({"fading": 0.0, "seed": seed})
        picture = render(device, frame, [thing], view, chosen, frames=40)
        inside = picture.aovs["coverage"] == 1.0
        assert picture.color[inside].max() < frame.radiance.max()


def test_its_shadow_reaches_what_the_object_reflects(device: ComputeDevice) -> None:
    """The floor before a ball is in the ball's shadow, so the ball's lower side is dark."""
    room = replace(ROOM, irradiance=(60.0, 50.0, 40.0))
    frame = replace(room.frame(512, 256), sun=Sun(room.sun, room.irradiance))
    color = (0.6, 0.6, 0.6)
    thing, solid = object_at(LIT - np.array([0.0, 0.95 * RADIUS, 0.0]), color)
    normal = np.array([-0.8, -0.1, 0.4])
    normal /= np.linalg.norm(normal)
    point = np.asarray(solid.centre) + RADIUS * normal
    d = cosine_about(np.broadcast_to(normal, (200_000, 3)), np.random.default_rng(3))
    t, facing, _ = room.world.first_hit(point + 1e-6 * normal, d)
    met = point + t[:, None] * d
    light = room.radiance(met, facing)
    others = replace(room, irradiance=(0.0, 0.0, 0.0)).radiance(met, facing)
    hidden = np.isfinite(solid.interval(met, np.broadcast_to(room.sun, met.shape))[0])
    shaded = np.where(hidden[:, None], others, light).mean(axis=0)
    assert (light.mean(axis=0) > 1.35 * shaded).all()
    view = looking_at(point)
    picture, _ = mean_picture(device, frame, thing, view)
    found = picture[pixel(view, point)].mean(axis=(0, 1))
    # The ball also takes some of the floor's other light.
    np.testing.assert_allclose(found, np.array(color) * shaded, rtol=0.2)


@pytest.mark.parametrize(("at", "lit"), [(LIT, True), (np.array([-1.2, FLOOR, 1.5]), False)])
def test_objects_in_the_sun_are_marked(
    device: ComputeDevice, frame: Frame, at: Float, lit: bool
) -> None:
    """Some points of the one object's box are in the sun, and none of the other's."""
    things = [
        object_at(LIT + np.array([0.0, 0.0, 5.0]), (0.6,) * 3)[0],
        object_at(at, (0.6,) * 3)[0],
    ]
    low, high = np.asarray(at) - RADIUS, np.asarray(at) + RADIUS + ABOVE
    box = low + np.random.default_rng(0).random((1000, 3)) * (high - low)
    assert ROOM.sunlit(box).any() == lit
    with Renderer(device, sunny(frame), things, looking_at(LIT), settings(rays=1)) as renderer:
        renderer.step()
        assert renderer._objects is not None
        sunlit = renderer._objects.sunlit
        assert sunlit is not None
        assert bool(sunlit.marks.get()[1]) == lit


def test_it_lights_a_yard_from_behind_a_pillar(device: ComputeDevice) -> None:
    """Seen from the capture centre, rays towards it end behind the pillar."""
    yard = SunnyYard(np.array([-0.8, 0.5, 0.05]) / np.linalg.norm([0.8, 0.5, 0.05]))
    at = np.array([0.4, GROUND, -1.9])
    assert yard.sunlit(at + 0.01)
    frame = replace(yard.frame(512, 256), sun=Sun(yard.sun, yard.irradiance))
    color = (0.6, 0.6, 0.6)
    thing, solid = object_at(at, color)
    normal = np.array([-0.2, 0.8, 0.6])
    normal /= np.linalg.norm(normal)
    point = np.asarray(solid.centre) + RADIUS * normal
    assert yard.sunlit(point)
    d = cosine_about(np.broadcast_to(normal, (100_000, 3)), np.random.default_rng(3))
    others = yard.radiance(point, d).mean(axis=0)
    facing = max(normal @ yard.sun, 0.0) / np.pi * np.array(yard.irradiance)
    view = looking_at(point, fov=12.0)
    picture, _ = mean_picture(device, frame, thing, view)
    found = picture[pixel(view, point)].mean(axis=(0, 1))
    np.testing.assert_allclose(found, np.array(color) * (others + facing), rtol=0.1)


def test_the_edges_of_its_shadows_are_smooth(device: ComputeDevice, frame: Frame) -> None:
    """Pixels across an edge have all shares of the shadow, as often as an area has them."""
    thing, solid = object_at(LIT + np.array([0.0, 0.3, 0.0]), (0.0, 0.0, 0.0))
    shade = np.asarray(solid.centre) - (solid.centre[1] - FLOOR) / ROOM.sun[1] * ROOM.sun
    small = replace(sunny(frame), sun=Sun(ROOM.sun, ROOM.irradiance, angle_deg=0.01))
    _, ratio = mean_picture(device, small, thing, looking_at(shade, size=32, fov=24.0))
    dark, bright = ratio[..., 1].min(), np.median(ratio[..., 1].max(axis=0))
    share = (bright - ratio[..., 1]) / (bright - dark)
    between = ((share > 0.25) & (share < 0.75)).sum()
    edge = np.abs(np.diff(share > 0.5, axis=0)).sum() + np.abs(np.diff(share > 0.5, axis=1)).sum()
    assert edge > 20
    assert between > 0.25 * edge


def test_layers_of_irradiance_contain_it(device: ComputeDevice, frame: Frame) -> None:
    """Their quotient is the ratio, in the patch and beside it, in the shadow and out of it."""
    thing, solid = object_at(LIT, (0.0, 0.0, 0.0))
    shade = np.asarray(solid.centre) - (solid.centre[1] - FLOOR) / ROOM.sun[1] * ROOM.sun
    view = looking_at(shade)
    chosen = settings(rays=8, estimator="delta", **RAW)
    pictures = [
        render(device, one, [thing], view, chosen, frames=16) for one in (sunny(frame), frame)
    ]
    real, without = (picture.aovs["irradiance_real"] for picture in pictures)
    here = pixel(view, shade)
    up = np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose((real - without)[here].mean((0, 1)), sunlight(up), rtol=0.02)
    mixed, ratio = (pictures[0].aovs[name] for name in ("irradiance_mixed", "ratio"))
    np.testing.assert_allclose((mixed / real)[here], ratio[here], atol=0.02)


@pytest.mark.thorough
@pytest.mark.parametrize("thin", [False, True])
def test_the_sun_shines_through_glass(device: ComputeDevice, frame: Frame, thin: bool) -> None:
    """Glass that does not bend light tints the sun's part below it, twice, as all else."""
    tint = 0.6
    _, solid = object_at(LIT, (0.0, 0.0, 0.0))
    clear = Material("dielectric", (tint,) * 3, alpha=0.0, ior=1.0001, thin=thin)
    thing = ball(solid.centre, RADIUS, clear)
    shade = np.asarray(solid.centre) - (solid.centre[1] - FLOOR) / ROOM.sun[1] * ROOM.sun
    view = looking_at(shade)
    up = np.array([0.0, 1.0, 0.0])
    _, ratio = mean_picture(device, sunny(frame), thing, view)
    whole, dark = room_light(shade, up), room_light(shade, up, solid)
    lit = dark + tint**2 * (whole - dark + sunlight(up))
    shown = ratio[pixel(view, shade)].mean(axis=(0, 1))
    np.testing.assert_allclose(shown, lit / (whole + sunlight(up)), rtol=0.06)


@pytest.mark.thorough
def test_the_sun_shines_on_objects_through_glass(device: ComputeDevice, frame: Frame) -> None:
    """A sheet that is as good as invisible changes nothing on a matte ball in its shadow."""
    thing, solid = object_at(LIT, (0.5, 0.5, 0.5))
    clear = Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0, ior=1.0001, thin=True)
    above = np.asarray(solid.centre) + 2.0 * RADIUS / ROOM.sun[1] * ROOM.sun
    sheet = disc(above, 2.0 * RADIUS, clear)
    view = looking_at(np.asarray(solid.centre) - [0.0, 0.3 * RADIUS, 0.0], size=24, fov=12.0)
    chosen = settings(rays=8, estimator="delta", **RAW)
    alone, covered = (
        render(device, sunny(frame), objects, view, chosen, frames=24).color
        for objects in ([thing], [thing, sheet])
    )
    np.testing.assert_allclose(covered.mean((0, 1)), alone.mean((0, 1)), rtol=0.02)
