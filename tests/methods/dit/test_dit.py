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
from iprt.methods.dit.method import middle_of, radius_of
from iprt.renderer import Renderer
from tests.oracles.worlds import Box, World
from tests.rendering import render
from tests.trace.closed_forms import BALL, LAMP, box_of, confirm_ball
from tests.trace.environments import CLAY, windowed
from tests.trace.estimators import Around, Estimator, furnace, kernels, lamps
from tests.variants import as_traced
from tests.worlds import ball, bright_walls, room_frame, sphere_frame

LOOK = View(48, 36, pitch_deg=-35.0)


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
    """An even environment: the ball hides (r / d)² cos β, and sends its albedo's part."""
    frame, objects = furnace(around), [ball(*BALL, LAMP)]
    own = {"resolution": 32, "iterations": 8, **own}
    with kernels(device, frame, objects, estimator, own=own) as run:
        lights = run.renderer.world.lights
        if lights is not None:
            lights.load(run.device.upload("lamps", lamps(frame).astype(np.float32)))
            assert run.device.read(lights.arguments().column)[-1] > 0.0
        confirm_ball(run, objects[0], 256, rounding=3e-3)


def test_only_as_many_rays_as_the_cache_holds(device: ComputeDevice) -> None:
    """A ray that stands for many makes noise, and no bias."""
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


# Objects -------------------------------------------------------------------------------------


def patterned(width: int = 256, height: int = 128, radius: float = 2.5) -> Frame:
    """The inside of a sphere with a smooth pattern."""
    d = View(width, height, projection="equirect").directions()
    color = 0.6 + 0.4 * np.sin(5.0 * d) * d[..., ::-1]
    return replace(sphere_frame(radius, width, height, 1.0), color=color.astype(np.float32))


@pytest.mark.thorough
def test_a_convex_room_is_that_of_iprt(device: ComputeDevice) -> None:
    """All is seen from the middle of the objects: nothing is left to approximate but the map."""
    objects = [ball(*BALL, CLAY), box_of(Material(albedo=(0.5, 0.4, 0.3)))]
    trace = {"object_rays": 16, "bounces": 1, "jitter": False, "background": False}
    own: dict[str, Any] = {"dit": {"iterations": 12, "cache": 32}}
    ours, theirs = (
        render(device, windowed(256, 128), objects, LOOK, settings, 24).color
        for settings in (
            as_traced("dit", trace={**trace, "rays": 64}, **own),
            as_traced("iprt", trace={**trace, "rays": 16}, iprt={"relight_reflections": False}),
        )
    )
    assert abs(ours.mean() - theirs.mean()) < 5e-3 * theirs.mean()
    assert np.abs(ours - theirs).mean() < 0.02 * theirs.mean()


# The map follows -----------------------------------------------------------------------------


@pytest.mark.thorough
def test_the_map_follows_objects_and_video(device: ComputeDevice) -> None:
    objects = [ball((0.3, -0.5, -1.0), 0.3, CLAY)]
    frame = patterned(128, 64)
    settings = as_traced("dit", dit={"resolution": 16})
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


def test_the_middle_of_several_objects() -> None:
    bounds = np.zeros((2, 2, 4), np.float32)
    bounds[0, :, :3] = (-1.0, 0.0, 2.0), (1.0, 0.5, 3.0)
    bounds[1, :, :3] = (2.0, -0.5, 2.5), (4.0, 0.0, 5.0)
    np.testing.assert_array_equal(middle_of(bounds), (1.5, 0.0, 3.5))
    assert radius_of(bounds) == pytest.approx(0.5 * np.sqrt(25.0 + 1.0 + 9.0))
