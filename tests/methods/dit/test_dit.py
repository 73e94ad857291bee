"""Distance impostor tracing: closed forms, `iprt` where both are exact, and all its strategies."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.methods.dit import method as dit_method
from iprt.methods.dit.method import SLACK, middle_of, radius_of
from iprt.renderer import Renderer
from iprt.settings.model import Settings
from tests.kernels.wrap import evaluate
from tests.oracles.worlds import Box, World
from tests.rendering import render
from tests.trace.environments import CLAY, windowed
from tests.trace.estimators import Around, Estimator, confirm, furnace, kernels, lamps
from tests.trace.test_estimators import BALL, LAMP, RUNS, as_large, ball_factor, box_of
from tests.worlds import Float, ball, bright_walls, room_frame, sphere_frame

LOOK = View(48, 36, pitch_deg=-35.0)
MIRROR = Material("conductor", (0.9, 0.8, 0.7), alpha=0.0)


def dit(**others: Any) -> Settings:
    """As traced: what remains is noise, which averages out."""
    raw: dict[str, Any] = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}}
    return Settings.model_validate({"method": "dit", **raw, **others})


# Real surfaces -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("estimator", "around", "own"),
    [
        ("dit, aimed", "plain", {"cache": 32}),
        pytest.param("dit, even", "plain", {"cache": 6}, marks=pytest.mark.thorough),
        ("dit, even", "sphere", {"directions": "all"}),
        pytest.param("dit, aimed", "sphere", {"directions": "boxes"}, marks=pytest.mark.thorough),
    ],
)
def test_a_ball_takes_its_form_factor(
    device: ComputeDevice, estimator: Estimator, around: Around, own: dict[str, Any]
) -> None:
    """In an even environment: it hides (r / d)² cos β, and sends its albedo's part of that."""
    frame, objects = furnace(around), [ball(*BALL, LAMP)]
    own = {"resolution": 32, "iterations": 8, **own}
    with kernels(device, frame, objects, estimator, own=own) as run:
        lights = run.renderer.world.lights
        if lights is not None:
            lights.load(run.device.upload("lamps", lamps(frame).astype(np.float32)))
            assert lights.count > 0
        factor = ball_factor(*run.receivers(), BALL[0], as_large(objects[0], BALL[1]))
        parts = np.array([run.parts(seed, 256) for seed in range(RUNS)])
    confirm(parts[..., 0, 0].reshape(RUNS, -1), factor.ravel(), rounding=3e-3)
    for channel in np.flatnonzero(LAMP.albedo):
        sent = parts[..., 1, channel].reshape(RUNS, -1)
        confirm(sent, LAMP.albedo[channel] * factor.ravel(), rounding=3e-3)


@pytest.mark.thorough
def test_every_strategy_has_one_mean(device: ComputeDevice) -> None:
    """Where light is uneven: cached directions or all, aimed at boxes, at lights or at neither."""
    frame, objects = windowed(), [ball(*BALL, CLAY), box_of(LAMP)]
    means = {}
    ways: tuple[tuple[Estimator, dict[str, Any]], ...] = (
        ("dit, aimed", {"directions": "boxes"}),
        ("dit, aimed", {"cache": 4}),
        ("dit, even", {"cache": 64}),
        ("dit, aimed", {"directions": "all"}),
    )
    for estimator, own in ways:
        with kernels(device, frame, objects, estimator, own={"resolution": 32, **own}) as run:
            parts = np.array([run.parts(seed, 256) for seed in range(24)])
        means[estimator, str(own)] = parts.mean(axis=(1, 2, 4))
    wanted = np.mean([of.mean(0) for of in means.values()], axis=0)
    for way, of in means.items():
        error = of.std(0, ddof=1) / np.sqrt(len(of))
        assert (error < 0.015 * wanted).all(), way
        assert (np.abs(of.mean(0) - wanted) < 4.0 * error + 0.01 * wanted).all(), way


def test_only_as_many_rays_as_the_cache_holds(device: ComputeDevice) -> None:
    """One of many that meet the box stands for all: noisier than if all were traced, but right."""
    frame, objects = furnace("plain"), [ball(*BALL, LAMP)]
    found = []
    for cache in (1, 64):
        own = {"resolution": 32, "cache": cache}
        with kernels(device, frame, objects, "dit, even", own=own) as run:
            near = run.receivers()[0]
            found.append(np.array([run.parts(seed, 64)[..., 0, 0] for seed in range(12)]))
    one, all_of_them = found
    close = np.linalg.norm(near - np.array(BALL[0]), axis=-1) < 2.0 * BALL[1]
    assert close.sum() > 10
    assert one[:, close].std(0).mean() > 2.0 * all_of_them[:, close].std(0).mean()
    assert one[:, close].mean() == pytest.approx(all_of_them[:, close].mean(), rel=0.05)


@pytest.mark.parametrize("directions", ["cached", "boxes"])
def test_nothing_changes_behind_what_hides_the_objects(
    device: ComputeDevice, directions: str
) -> None:
    """The floor below a table gets no light from a ball above it, and keeps its own."""
    table = Box((0.1, -0.55, -1.2), (0.5, 0.03, 0.4))
    at, radius = np.array([0.1, -0.3, -1.2]), 0.12
    frame = room_frame(World(solids=(table,)), 256, 128, bright_walls)
    own = {"directions": directions, "cache": 64}
    view = View(28, 28, pitch_deg=-45.0, fov_y_deg=70.0)
    objects = [ball(tuple(at), radius, LAMP)]
    with kernels(device, frame, objects, "dit, even", view=view, own=own) as run:
        points, _ = run.receivers()
        change = np.abs(run.parts(0, 256)).max(axis=(-1, -2))
    ends = at + radius * np.array(list(product((-1.0, 1.0), repeat=3)))
    hidden = np.ones(points.shape[:2], bool)
    for end in ends:
        enters, leaves, *_ = table.interval(points, end - points)
        hidden &= (enters > 0.01) & (enters < leaves) & (leaves < 1.0)
    assert hidden.sum() > 20
    assert not change[hidden].any()
    on_top = np.abs(points[..., 1] + 0.52) < 0.01
    assert on_top.sum() > 20
    assert (change[on_top] > 0.0).mean() > 0.9


def test_boxes_are_met_as_slabs_say(device: ComputeDevice) -> None:
    rng = np.random.default_rng(0)
    corners = np.sort(rng.uniform(-1.0, 1.0, (2, 2, 3)), axis=1)
    boxes = np.zeros((4, 4), np.float32)
    boxes[:, :3] = corners.reshape(4, 3)
    o, d = rng.uniform(-1.5, 1.5, (1000, 3)), rng.normal(size=(1000, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    rays = {"o": o.astype(np.float32), "d": d.astype(np.float32)}
    body = "met = meets_boxes(boxes, 2, o, d);"
    header = ["world/boxes.h"]
    found = evaluate(device, header, body, rays, {"met": "int"}, tables={"boxes": boxes})["met"]
    t = np.linspace(0.0, 6.0, 2001)[:, None, None]
    points = o + t * d
    met = np.zeros(len(o), bool)
    for low, high in corners:
        met |= ((points > low) & (points < high)).all(-1).any(0)
    assert 0.1 < met.mean() < 0.9
    assert (found != met).mean() < 5e-3


# Objects -------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("view", [View(64, 48), View(128, 64, projection="equirect")])
def test_even_light_shows_the_albedo(device: ComputeDevice, view: View) -> None:
    frame = sphere_frame(2.0, 128, 64, 0.7)
    picture = render(device, frame, [ball((0.3, -0.2, -1.0), 0.35, CLAY)], view, dit(), 2)
    inside = picture.aovs["coverage"] == 1.0
    assert inside.sum() > 80
    wanted = np.broadcast_to(0.7 * np.array(CLAY.albedo), (inside.sum(), 3))
    np.testing.assert_allclose(picture.color[inside], wanted, rtol=1e-5)


def patterned(width: int = 256, height: int = 128, radius: float = 2.5) -> Frame:
    """The inside of a sphere with a smooth pattern."""
    d = View(width, height, projection="equirect").directions()
    color = 0.6 + 0.4 * np.sin(5.0 * d) * d[..., ::-1]
    return replace(sphere_frame(radius, width, height, 1.0), color=color.astype(np.float32))


@pytest.mark.thorough
def test_what_a_mirror_shows_depends_on_its_place(device: ComputeDevice) -> None:
    """As with exact rays, and unlike a distant environment (section 8: EM lights uniformly)."""
    objects = [ball((0.5, -0.6, -1.4), 0.35, MIRROR), ball((-0.6, -0.5, -1.2), 0.3, MIRROR)]

    def shown(method: str) -> Float:
        settings = dit(method=method, trace={"bounces": 1, "jitter": False})
        picture = render(device, patterned(), objects, LOOK, settings, 1)
        return np.asarray(picture.color[picture.aovs["coverage"] == 1.0])

    exact, impostor, distant = (shown(method) for method in ("iprt", "dit", "em"))
    assert np.abs(impostor - exact).mean() < 0.015
    assert np.abs(distant - exact).mean() > 5.0 * np.abs(impostor - exact).mean()


@pytest.mark.thorough
def test_a_convex_room_is_that_of_iprt(device: ComputeDevice) -> None:
    """All is seen from the middle of the objects: nothing is left to approximate but the map."""
    objects = [ball(*BALL, CLAY), box_of(Material(albedo=(0.5, 0.4, 0.3)))]
    trace = {"object_rays": 16, "bounces": 1, "jitter": False, "background": False}
    own: dict[str, Any] = {"dit": {"iterations": 12, "cache": 32}}
    ours, theirs = (
        render(device, windowed(256, 128), objects, LOOK, dit(**raw), 24).color
        for raw in (
            {"trace": {**trace, "rays": 64}, **own},
            {
                "method": "iprt",
                "iprt": {"relight_reflections": False},
                "trace": {**trace, "rays": 16},
            },
        )
    )
    assert abs(ours.mean() - theirs.mean()) < 5e-3 * theirs.mean()
    assert np.abs(ours - theirs).mean() < 0.02 * theirs.mean()


# The map follows -----------------------------------------------------------------------------


@pytest.mark.thorough
def test_the_map_follows_objects_and_video(device: ComputeDevice) -> None:
    objects = [ball((0.3, -0.5, -1.0), 0.3, CLAY)]
    frame = patterned(128, 64)
    settings = dit(dit={"resolution": 16})
    with Renderer(device, frame, objects, LOOK, settings) as renderer:
        renderer.step()
        impostor = renderer.method.impostor
        first = device.read(impostor.texels)
        np.testing.assert_allclose(impostor.centre, (0.3, -0.5, -1.0), atol=1e-4)
        moved = objects[0].to_world.copy()
        moved[0, 3] -= 0.5
        renderer.move([replace(objects[0], to_world=moved)])
        renderer.step()
        np.testing.assert_allclose(impostor.centre, (-0.2, -0.5, -1.0), atol=1e-4)
        second = device.read(impostor.texels)
        assert np.abs(second[:, 3] - first[:, 3]).max() > 0.05
        renderer.load(replace(frame, color=2.0 * frame.color))
        renderer.step()
        third = device.read(impostor.texels)
        np.testing.assert_allclose(third[:, :3], 2.0 * second[:, :3], rtol=1e-5)
        np.testing.assert_array_equal(third[:, 3], second[:, 3])


@pytest.mark.thorough
def test_a_map_that_stays_shows_nearly_what_a_fresh_one_does(
    device: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mirror that moves: off by at most 0.1% of the room's light on average.

    Once it is at rest, the map is that of its place.
    """
    frame = replace(World().frame(256, 128), color=patterned(256, 128).color)
    start = ball((0.3, -0.5, -0.8), 0.4, MIRROR)
    settings = dit(dit={"resolution": 128}, trace={"jitter": False})
    reach = SLACK * np.sqrt(3.0) * 0.4

    def shown(way: float, stays: bool) -> tuple[Float, Float]:
        """Picture and coverage while the objects move."""
        to_world = start.to_world.copy()
        to_world[0, 3] -= way
        with Renderer(device, frame, [start], LOOK, settings) as renderer:
            renderer.step()
            impostor = renderer.method.impostor
            first = impostor.centre
            renderer.move([replace(start, to_world=to_world)])
            picture = renderer.render(1, ["coverage"])
            there = first - np.array([way, 0.0, 0.0], np.float32)
            np.testing.assert_allclose(impostor.centre, first if stays else there, atol=1e-4)
            renderer.render(2)
            np.testing.assert_allclose(impostor.centre, there, atol=1e-4)
        return picture.color, picture.aovs["coverage"]

    shown(1.1 * reach, stays=False)
    kept, coverage = shown(0.9 * reach, stays=True)
    monkeypatch.setattr(dit_method, "SLACK", 0.0)
    fresh, _ = shown(0.9 * reach, stays=False)
    assert (coverage == 1.0).sum() > 100
    apart = np.abs(kept - fresh)[coverage == 1.0].mean() / frame.color.mean()
    assert 0.0 < apart < 1e-3


def test_the_middle_of_several_objects() -> None:
    bounds = np.zeros((2, 2, 4), np.float32)
    bounds[0, :, :3] = (-1.0, 0.0, 2.0), (1.0, 0.5, 3.0)
    bounds[1, :, :3] = (2.0, -0.5, 2.5), (4.0, 0.0, 5.0)
    np.testing.assert_array_equal(middle_of(bounds), (1.5, 0.0, 3.5))
    assert radius_of(bounds) == pytest.approx(0.5 * np.sqrt(25.0 + 1.0 + 9.0))
