"""Lights without geometry: closed forms on a plain and on objects."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.light import PROFILE_SHAPE, Light
from tests.trace.closed_forms import BLACK
from tests.trace.estimators import confirm, furnace, kernels
from tests.trace.virtual_lights import DOWN, PLACE, from_point, lit_by
from tests.worlds import Float, cuboid

RAYS, RUNS = 16, 16
COLOR = (3.0, 6.0, 40.0)
TURN = np.array([[0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])


# Real surfaces -------------------------------------------------------------------------------


def spot_falloff(points: Float, inner_deg: float, outer_deg: float) -> Float:
    """Share of the intensity of a light at `PLACE` that shines down (KHR_lights_punctual)."""
    away = points - np.asarray(PLACE)
    cosine = -away[..., 1] / np.linalg.norm(away, axis=-1)
    inner, outer = np.cos(np.deg2rad([inner_deg, outer_deg]))
    return np.asarray(np.clip((cosine - outer) / (inner - outer), 0.0, 1.0) ** 2)


def profiled() -> tuple[Light, Callable[[Float], Float]]:
    """A light, turned by `TURN`, whose intensity depends on both angles; and that dependence."""
    polar = np.linspace(0.0, np.pi, PROFILE_SHAPE[0])[:, None]
    turn = np.linspace(0.0, 2.0 * np.pi, PROFILE_SHAPE[1])[None]
    table = (0.5 + 0.5 * np.cos(polar)) * (0.7 + 0.3 * np.cos(turn) * np.sin(polar))

    def share(points: Float) -> Float:
        local = (points - np.asarray(PLACE)) @ (TURN @ DOWN)
        local /= np.linalg.norm(local, axis=-1, keepdims=True)
        return np.asarray((0.5 - 0.5 * local[..., 2]) * (0.7 + 0.3 * local[..., 0]))

    return Light("sphere", COLOR, profile=table.astype(np.float32)), share


def from_rectangle(points: Float, normals: Float, corner: Float, a: Float, b: Float) -> Float:
    """(...) irradiance of a rectangle of radiance 1 that shines down, by 80 x 80 points."""
    steps = (np.arange(80) + 0.5) / 80
    total = np.zeros(points.shape[:-1])
    for u in steps:
        for v in steps:
            away = corner + u * a + v * b - points
            d2 = (away**2).sum(-1)
            total += np.maximum((away * normals).sum(-1), 0.0) * away[..., 1] / d2**2
    return np.asarray(total * np.linalg.norm(np.cross(a, b)) / len(steps) ** 2)


@pytest.mark.parametrize("radius", [0.0, 0.2])
def test_a_sphere_lights_the_plain_as_its_centre_does(device: ComputeDevice, radius: float) -> None:
    """Above the horizon of all of them, the form factor of a sphere is (r / d)² cos β."""
    lamp = lit_by(Light("sphere", COLOR, radius=0.5 * radius), linear=2.0 * DOWN)
    with kernels(device, furnace("plain"), [lamp], "delta, even") as run:
        wanted = from_point(*run.receivers()).ravel() / np.pi
        change = np.array([run.change(seed, RAYS) for seed in range(RUNS)])
    for channel, intensity in enumerate(COLOR):
        found = change[..., channel].reshape(RUNS, -1)
        confirm(found, intensity * wanted, rounding=2e-4)


def test_a_spot_lights_the_plain(device: ComputeDevice) -> None:
    lamp = lit_by(Light("sphere", COLOR, cone_deg=(15.0, 35.0)))
    with kernels(device, furnace("plain"), [lamp], "delta, even") as run:
        points, normals = run.receivers()
        share = spot_falloff(points, 15.0, 35.0)
        wanted = (share * from_point(points, normals)).ravel() / np.pi
        change = np.array([run.change(seed, RAYS)[..., 2] for seed in range(RUNS)])
    assert (share == 0.0).any()
    assert (share == 1.0).any()
    confirm(change.reshape(RUNS, -1), COLOR[2] * wanted, rounding=2e-4)


@pytest.mark.thorough
def test_a_profile_lights_the_plain(device: ComputeDevice) -> None:
    """Two lights have tables, one below the other."""
    light, share = profiled()
    dark = Light("sphere", (1e-9,) * 3, profile=np.ones(PROFILE_SHAPE, np.float32))
    lamps = [lit_by(dark, name="dark"), lit_by(light, linear=TURN @ DOWN)]
    with kernels(device, furnace("plain"), lamps, "delta, even") as run:
        points, normals = run.receivers()
        wanted = (share(points) * from_point(points, normals)).ravel() / np.pi
        change = np.array([run.change(seed, RAYS)[..., 0] for seed in range(RUNS)])
    assert np.ptp(share(points)) > 0.1
    confirm(change.reshape(RUNS, -1), COLOR[0] * wanted, rounding=1e-3)


def test_a_rectangle_lights_the_plain(device: ComputeDevice) -> None:
    """Turned about the vertical, and scaled along its own axes."""
    scaled = TURN @ DOWN @ np.diag([2.0, 0.5, 3.0])
    lamp = lit_by(Light("rectangle", COLOR, size=(0.25, 0.8)), linear=scaled)
    a, b = 0.5 * TURN @ DOWN[:, 0], 0.4 * TURN @ DOWN[:, 1]
    with kernels(device, furnace("plain"), [lamp], "delta, even") as run:
        points, normals = run.receivers()
        corner = np.asarray(PLACE) - 0.5 * a - 0.5 * b
        factor = from_rectangle(points, normals, corner, a, b).ravel() / (0.5 * 0.4)
        change = np.array([run.change(seed, RAYS)[..., 0] for seed in range(RUNS)])
    confirm(change.reshape(RUNS, -1), COLOR[0] * factor / np.pi, rounding=5e-4)


def test_a_rectangle_shines_to_one_side(device: ComputeDevice) -> None:
    lamp = lit_by(Light("rectangle", COLOR), linear=-DOWN)
    with kernels(device, furnace("plain"), [lamp], "delta, even") as run:
        assert np.abs(run.change(0, RAYS)).max() == 0.0


def test_a_sun_lights_the_plain(device: ComputeDevice) -> None:
    tilted = np.array([[1.0, 0, 0], [0, 0.6, 0.8], [0, -0.8, 0.6]]) @ DOWN
    towards = tilted[:, 2]
    lamp = lit_by(Light("sun", COLOR, diameter_deg=8.0), linear=tilted)
    with kernels(device, furnace("plain"), [lamp], "delta, even") as run:
        normals = run.receivers()[1]
        wanted = (normals @ towards).ravel() / np.pi
        change = np.array([run.change(seed, RAYS)[..., 0] for seed in range(RUNS)])
    assert wanted.min() > 0.1
    confirm(change.reshape(RUNS, -1), COLOR[0] * wanted)


@pytest.mark.thorough
def test_many_lights_add_up(device: ComputeDevice) -> None:
    """One of them is chosen for each ray, of which some shine on parts of the plain alone."""
    places = [(0.2, -0.5, -0.9), (-0.5, -1.2, -0.6), (0.4, -1.4, -0.4), (0.0, -0.2, -1.5)]
    kinds = [
        Light("sphere", (1.0,) * 3),
        Light("sphere", (0.1,) * 3, radius=0.05),
        Light("sphere", (0.02,) * 3),
        Light("sphere", (2.0,) * 3, cone_deg=(5.0, 6.0)),
    ]
    lamps = [
        lit_by(light, place, name=f"light {number}")
        for number, (light, place) in enumerate(zip(kinds, places, strict=True))
    ]
    with kernels(device, furnace("plain"), lamps, "delta, even") as run:
        points, normals = run.receivers()
        wanted = sum(
            light.intensity[0] * from_point(points, normals, place)
            for light, place in zip(kinds[:3], places[:3], strict=True)
        )
        beside = points + np.asarray(PLACE) - places[3]
        wanted += 2.0 * spot_falloff(beside, 5.0, 6.0) * from_point(points, normals, places[3])
        change = np.array([run.change(seed, 64)[..., 0] for seed in range(64)])
    confirm(change.reshape(64, -1), wanted.ravel() / np.pi, rounding=5e-4)


# Objects -------------------------------------------------------------------------------------


TOP = View(40, 30, pitch_deg=-50.0, fov_y_deg=60.0)


@pytest.mark.parametrize("bounces", [1, pytest.param(2, marks=pytest.mark.thorough)])
def test_a_point_lights_an_object(device: ComputeDevice, bounces: int) -> None:
    """The top of a black box in a furnace, also where the box is a path's last surface."""
    box = cuboid((0.1, -1.0, -1.0), (0.5, 0.1, 0.4), BLACK)
    lamp = lit_by(Light("sphere", COLOR), (0.1, 0.1, -1.0))
    trace = {"bounces": bounces}
    with kernels(
        device, furnace("sphere"), [box, lamp], "delta, even", view=TOP, trace=trace
    ) as run:
        layer = run.renderer.layout
        normal, place = (
            np.moveaxis(layer.interior(run.device.read(planes)), 0, -1).astype(np.float64)
            for planes in (run.renderer.visible.normal, run.renderer.visible.depth)
        )
        top = normal[..., 1] > 0.999
        points = place * TOP.directions()
        up = np.broadcast_to(np.array([0.0, 1.0, 0.0]), points.shape)
        wanted = from_point(points, up, (0.1, 0.1, -1.0))[top] / np.pi
        found = np.array([run.reflected(seed, 64)["diffuse"][top] for seed in range(64)])
    assert top.sum() > 100
    for channel, intensity in enumerate(COLOR):
        confirm(found[..., channel], 1.0 + intensity * wanted, rounding=5e-4)
