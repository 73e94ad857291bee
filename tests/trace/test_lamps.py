"""Objects that emit light: closed forms of balls and discs, and the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.geometry.sampler import Sampler
from iprt.renderer import RenderedFrame
from iprt.settings.model import Settings
from tests.meshes import transform
from tests.oracles.worlds import Box, World
from tests.raster.shapes import quad
from tests.rendering import render
from tests.trace.closed_forms import BALL, DISC, RUNS, as_large, ball_factor, disc_factor
from tests.trace.estimators import PLAIN, Estimator, confirm, furnace, kernels, lamps
from tests.worlds import Float, ball, bright_walls, cuboid, disc, room_frame, sphere_frame

RAYS = 32
COLOR = (3.0, 6.0, 40.0)
GLOW = Material(albedo=(0.0, 0.0, 0.0), emission=COLOR)
BLACK = Material(albedo=(0.0, 0.0, 0.0))


# Real surfaces -------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("estimator", ["delta, aimed", "delta, even", "ratio", "pt-diff, even"])
def test_a_ball_lights_the_plain(device: ComputeDevice, estimator: Estimator) -> None:
    """A spherical light above a plane: irradiance π L (r / d)² cos β, less the hidden light."""
    frame, lamp = furnace("plain"), ball(*BALL, GLOW)
    own = {"surfaces": "all"} if estimator.startswith("pt") else None
    with kernels(device, frame, [lamp], estimator, aim_at=lamps(frame), own=own) as run:
        factor = ball_factor(*run.receivers(), BALL[0], as_large(lamp, BALL[1])).ravel()
        change = np.array([run.change(seed, RAYS) for seed in range(RUNS)])
    for channel, emitted in enumerate(COLOR):
        confirm(change[..., channel].reshape(RUNS, -1), (emitted - 1.0) * factor)


@pytest.mark.gl
@pytest.mark.thorough
def test_a_ball_as_layers_lights_the_plain(device: ComputeDevice) -> None:
    """Layers are somewhat smaller than the ball."""
    frame, lamp = furnace("plain"), ball(*BALL, GLOW)
    with kernels(device, frame, [lamp], "iprt2023") as run:
        factor = ball_factor(*run.receivers(), BALL[0], as_large(lamp, BALL[1]))
        change = np.mean([run.change(seed, RAYS) for seed in range(16)], axis=0)
    found = change.mean(axis=(0, 1)) / ((np.array(COLOR) - 1.0) * factor.mean())
    np.testing.assert_allclose(found, found[0], rtol=1e-3)
    assert found[0] == pytest.approx(1.0, abs=0.1)


@pytest.mark.thorough
def test_a_disc_close_to_the_plain_lights_it(device: ComputeDevice) -> None:
    """Points of it are at all distances: neither technique suffices there alone."""
    centre, radius = (DISC[0][0], PLAIN + 0.12, DISC[0][2]), DISC[1]
    frame = furnace("plain")
    with kernels(device, frame, [disc(centre, radius, GLOW)], "delta, aimed") as run:
        factor = disc_factor(run.receivers()[0], centre, radius).ravel()
        change = np.array([run.change(seed, RAYS)[..., 0] for seed in range(RUNS)])
    confirm(change.reshape(RUNS, -1), (COLOR[0] - 1.0) * factor, rounding=5e-4)


# Objects -------------------------------------------------------------------------------------


TOP = View(40, 30, pitch_deg=-50.0, fov_y_deg=60.0)


@pytest.mark.thorough
@pytest.mark.parametrize("bounces", [1, 2])
def test_a_ball_lights_an_object(device: ComputeDevice, bounces: int) -> None:
    """The top of a box below it, also where the box is the last surface of a path."""
    centre, radius = (0.1, 0.1, -1.0), 0.25
    lamp, box = ball(centre, radius, GLOW), cuboid((0.1, -1.0, -1.0), (0.5, 0.1, 0.4), BLACK)
    frame = furnace("sphere")
    with kernels(
        device, frame, [box, lamp], aim_at=lamps(frame), view=TOP, trace={"bounces": bounces}
    ) as run:
        layer = run.renderer.layout
        normal, place = (
            np.moveaxis(layer.interior(run.device.read(planes)), 0, -1).astype(np.float64)
            for planes in (run.renderer.visible.normal, run.renderer.visible.depth)
        )
        top = normal[..., 1] > 0.999
        points = place * TOP.directions()
        up = np.broadcast_to(np.array([0.0, 1.0, 0.0]), points.shape)
        factor = ball_factor(points, up, centre, as_large(lamp, radius))[top]
        found = np.array([run.reflected(seed, RAYS)["diffuse"][top] for seed in range(RUNS)])
    assert top.sum() > 100
    for channel, emitted in enumerate(COLOR):
        confirm(found[..., channel], 1.0 + (emitted - 1.0) * factor, rounding=5e-4)


# Pictures ------------------------------------------------------------------------------------


VIEW = View(64, 48, pitch_deg=-40.0, fov_y_deg=60.0)
PLAINS = (Sampler(), Sampler(), Sampler())
WAYS = {
    "rays": {},
    "OpenGL": {"gbuffer": "gl"},
    "layers": {"method": "iprt2023"},
    "paths": {"method": "pt-diff", "pt-diff": {"surfaces": "all"}},
    "light at half the resolution": {"light_scale": 2},
}
MARKS = {"OpenGL": ["gl"], "layers": ["gl", "thorough"], "paths": ["thorough"]}
"""Thorough: their programs are needed nowhere else."""


def shown(
    device: ComputeDevice, *objects: Instance, frames: int = 8, **chosen: object
) -> RenderedFrame:
    settings = Settings.model_validate({"fading": 0.0, "atrous": {"levels": 0}, **chosen})
    frame = sphere_frame(2.0, 128, 64, 1.0)
    return render(device, frame, list(objects), VIEW, settings, frames)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[getattr(pytest.mark, mark) for mark in MARKS.get(name, ())])
        for name in WAYS
    ],
)
def test_a_lamp_shows_its_radiance(device: ComputeDevice, name: str) -> None:
    """Black but for its light, with a map that darkens its left half."""
    halves = np.ones((4, 8, 3), np.float32)
    halves[:, :4] = 0.25
    clamped = Sampler(("clamp", "clamp"))
    lamp = replace(GLOW, emission_texture=halves, samplers=(*PLAINS, clamped, Sampler()))
    turned = np.array([[1.0, 0, 0], [0, 0.77, 0.64], [0, -0.64, 0.77]])
    thing = Instance("lamp", quad((lamp,)), transform(0.7 * turned, (0.0, -1.0, -1.2)))
    picture = shown(device, thing, frames=1, **WAYS[name])
    inside = picture.aovs["coverage"] == 1.0
    column = np.arange(VIEW.width)
    for half, factor in ((column < 26, 0.25), (column > 37, 1.0)):
        seen = picture.color[inside & half]
        assert len(seen) > 100
        np.testing.assert_allclose(seen / COLOR, factor, rtol=2e-3)


STRONG = replace(BLACK, emission=(200.0, 200.0, 200.0))
SMALL = (0.0, -0.9, -0.9), 0.2
WHITE = 0.9
"""Reflectance, by which light grows, of surfaces as bright as their irradiance / π."""


def lit_by_small(picture: RenderedFrame) -> tuple[Float, Float]:
    """Form factors of a ball where it lights the sphere well, and the ratio there."""
    points = 2.0 * VIEW.directions()
    factor = ball_factor(points, -0.5 * points, *SMALL)
    beside = (picture.aovs["coverage"] == 0.0) & (factor > 0.02)
    assert factor[beside].max() > 0.03
    return factor[beside], picture.aovs["ratio"][beside][:, 0]


@pytest.mark.parametrize("name", ["rays", "light at half the resolution"])
def test_a_lamp_brightens_surfaces_far_beyond_their_irradiance(
    device: ComputeDevice, name: str
) -> None:
    """The inside of a white sphere near a lamp of two hundred times its radiance."""
    alone = {"iprt": {"relight_reflections": False}}
    picture = shown(device, ball(*SMALL, STRONG), frames=24, **(WAYS[name] | alone))
    factor, found = lit_by_small(picture)
    assert found.max() > 4.5
    assert found.mean() == pytest.approx(1.0 + WHITE * 199.0 * factor.mean(), rel=0.05)


@pytest.mark.thorough
def test_surfaces_pass_light_on(device: ComputeDevice) -> None:
    """Inside a sphere all points receive the mean of the reflected light, any number of times.

    The black lamp absorbs as much of it as it covers.
    """
    picture = shown(device, ball(*SMALL, STRONG), frames=150, fading=1.0)
    factor, found = lit_by_small(picture)
    covered = (SMALL[1] / 2.0) ** 2
    kept = WHITE * (1.0 - covered)
    wanted = WHITE * 199.0 * (factor.mean() + covered * kept / (1.0 - kept))
    assert found.mean() - 1.0 == pytest.approx(wanted, rel=0.05)


def test_an_object_shades_what_a_lamp_lights(device: ComputeDevice) -> None:
    """Behind a black board the lamp adds nothing."""
    lamp = ball((0.0, -0.3, -0.9), 0.03, GLOW)
    flat = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    board = Instance("board", quad((BLACK,)), transform(0.25 * flat, (0.0, -0.6, -0.9)))
    with_lamp, without = shown(device, board, lamp, frames=24), shown(device, board, frames=24)
    points = 2.0 * VIEW.directions()
    away = points - np.array([0.0, -0.3, -0.9])
    at_board = np.array([0.0, -0.3, -0.9]) + 0.3 / -away[..., 1:2] * away
    inner = (away[..., 1] < -0.3) & (np.abs(at_board - [0.0, -0.6, -0.9]).max(axis=-1) < 0.2)
    shade = inner & (with_lamp.aovs["coverage"] == 0.0)
    assert shade.sum() > 30
    added = with_lamp.aovs["ratio"][shade] - without.aovs["ratio"][shade]
    assert np.abs(added.mean(axis=0)).max() < 0.01
    lit = ~inner & (with_lamp.aovs["coverage"] == 0.0)
    assert (with_lamp.aovs["ratio"] - without.aovs["ratio"])[lit][:, 2].max() > 0.02


def test_a_mirror_shows_a_lamp(device: ComputeDevice) -> None:
    mirror = Material("conductor", (0.5, 0.5, 0.5), alpha=0.0)
    flat = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    floor = Instance("mirror", quad((mirror,)), transform(0.8 * flat, (0.0, -1.0, -1.2)))
    half = np.full((2, 2, 3), 0.5, np.float32)
    r, g, b = 2.0 * np.array(COLOR)
    hung = ball((0.0, -0.4, -1.9), 0.2, replace(GLOW, emission=(r, g, b), emission_texture=half))
    picture = shown(device, floor, hung, frames=4, trace={"jitter": False})
    seen: Float = picture.color[picture.aovs["coverage"] == 1.0]
    for value in (np.array(COLOR), 0.5 * np.array(COLOR)):
        assert (np.abs(seen - value) < 0.01 * value).all(axis=1).sum() > 10


def test_a_lamp_lights_the_last_surface_of_a_path(device: ComputeDevice) -> None:
    """A mirror shows the lower side of a white square that a lamp lights: one or two bounces."""
    mirror = Material("conductor", (1.0, 1.0, 1.0), alpha=0.0)
    flat = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    floor = Instance("mirror", quad((mirror,)), transform(0.15 * flat, (0.0, -1.2, -0.8)))
    white = Material(albedo=(0.8, 0.8, 0.8))
    square = Instance("square", quad((white,)), transform(0.5 * flat, (0.0, -0.4, -1.4)))
    things = floor, square, ball((0.3, -1.0, -1.5), 0.05, STRONG)
    one, two = (
        shown(device, *things, frames=24, trace={"jitter": False, "bounces": bounces})
        for bounces in (1, 2)
    )
    seen = (one.aovs["coverage"] == 1.0) & (VIEW.directions()[..., 1] < -0.75)
    assert seen.sum() > 30
    assert two.color[seen].mean() > 1.5
    assert one.color[seen].mean() == pytest.approx(two.color[seen].mean(), rel=0.1)


def test_a_lamp_on_a_board_does_not_light_it_from_below(device: ComputeDevice) -> None:
    """A mirror on the floor shows the lower side of a real board."""
    world = World(solids=(Box((0.0, -0.8, -1.35), (0.7, 0.01, 0.45)),))
    frame = room_frame(world, 256, 128, bright_walls)
    mirror = Material("conductor", (1.0, 1.0, 1.0), alpha=0.0)
    flat = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    floor = Instance("mirror", quad((mirror,)), transform(0.12 * flat, (0.0, -1.38, -0.7)))
    lamp = ball((0.0, -0.7, -1.2), 0.08, STRONG)
    view = View(64, 64, pitch_deg=-50.0, fov_y_deg=60.0)
    settings = Settings.model_validate({"fading": 0.0, "trace": {"jitter": False}})
    lit, unlit = (
        render(
            device,
            frame,
            [floor, replace(lamp, mesh=replace(lamp.mesh, materials=(of,)))],
            view,
            settings,
            8,
        )
        for of in (STRONG, replace(BLACK, emission=(1e-3, 1e-3, 1e-3)))
    )
    # The top is brighter by far, where the view shows it.
    assert lit.aovs["ratio"].max() > 5.0
    d = view.directions()
    at_board = (1.38 + 0.57) / -d[..., 1] * d[..., 2]
    seen = (lit.aovs["coverage"] == 1.0) & (d[..., 1] < -0.8) & (at_board < -0.95)
    assert seen.sum() > 30
    np.testing.assert_allclose(lit.color[seen], unlit.color[seen], rtol=0.02)
