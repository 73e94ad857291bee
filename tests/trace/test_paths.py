"""Delta path tracing and its baseline: closed forms, each other, and the paths of other methods."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.model import Settings
from iprt.trace.paths import Environment, support_plane
from tests.oracles.light import light_density
from tests.oracles.worlds import Sphere
from tests.rendering import render
from tests.trace.closed_forms import (
    BALL,
    BLACK,
    LAMP,
    RUNS,
    box_of,
    box_truth,
    confirm_ball,
)
from tests.trace.environments import UP, hidden_and_bounced, windowed
from tests.trace.estimators import PLAIN, Estimator, confirm, furnace, kernels, lamps
from tests.worlds import Float, ball, panorama_at

WAYS: tuple[Estimator, ...] = ("dpt, aimed", "dpt, even", "pt-diff, aimed")
ALL, PLANE = {"surfaces": "all"}, {"surfaces": "plane"}
RAYS = 160
"""Rays are not aimed at the objects: most miss."""
LOOK = View(40, 30, pitch_deg=-38.0, fov_y_deg=60.0)


# Real surfaces -------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("surfaces", "estimator"), [("all", WAYS[0]), ("plane", WAYS[1]), ("plane", WAYS[2])]
)
def test_a_ball_hides_light_and_shines(
    device: ComputeDevice, estimator: Estimator, surfaces: str
) -> None:
    """A spherical light above a plane: irradiance π L (r / d)² cos β, less what it hides."""
    frame, objects = furnace("plain"), [ball(*BALL, LAMP)]
    own = {"surfaces": surfaces}
    with kernels(device, frame, objects, estimator, aim_at=lamps(frame), own=own) as run:
        run.renderer.method.environment.plane = np.array([*UP, PLAIN], np.float32)
        confirm_ball(run, objects[0], RAYS, rounding=1e-3)


@pytest.mark.thorough
def test_one_bounce_is_shadow_alone(device: ComputeDevice) -> None:
    frame, objects = furnace("plain"), [ball(*BALL, LAMP)]
    own = {**ALL, "bounces": 1}
    with kernels(device, frame, objects, WAYS[0], aim_at=lamps(frame), own=own) as run:
        hidden, sent = np.moveaxis(run.parts(0, 4), -2, 0)
    assert hidden.max() > 0.0
    np.testing.assert_array_equal(sent, 0.0)


@pytest.mark.thorough
@pytest.mark.parametrize("estimator", WAYS[:2])
def test_a_window_casts_a_shadow_by_its_direction(
    device: ComputeDevice, estimator: Estimator
) -> None:
    """On a plane, light is infinitely far, but for what the plane itself sends."""
    frame, albedo = windowed(), np.array([0.9, 0.5, 0.1])
    objects = [ball(*BALL, Material(albedo=tuple(albedo)), subdivisions=5)]
    with kernels(device, frame, objects, estimator, own={**PLANE, "bounces": 1}) as run:
        points, normals = run.receivers()
        run.renderer.method.environment.plane = nearest_plane(points, normals)
        parts = np.array([run.parts(seed, 2 * RAYS) for seed in range(RUNS)])
        plane = run.renderer.method.environment.plane
    relit = (np.abs(points @ plane[:3] - plane[3]) < 0.018 * np.linalg.norm(points, axis=-1)) & (
        normals @ plane[:3] > 0.91
    )
    beside = np.abs(points @ plane[:3] - plane[3]) > 0.022 * np.linalg.norm(points, axis=-1)
    assert relit.sum() > 10
    assert beside.any()
    np.testing.assert_array_equal(parts[:, beside], 0.0)
    hidden, _ = hidden_and_bounced(frame, points[relit], normals[relit], Sphere(*BALL), albedo)
    confirm(parts[:, relit][..., 0, 0].reshape(RUNS, -1), hidden[:, 0], rounding=5e-3)


def nearest_plane(points: Float, normals: Float) -> Any:
    """The tangent plane in the middle of the view."""
    row, column = points.shape[0] // 2, points.shape[1] // 2
    normal = normals[row, column]
    return np.array([*normal, normal @ points[row, column]], np.float32)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["conductor", "plastic"])
@pytest.mark.parametrize("own", [ALL, PLANE], ids=["all", "plane"])
def test_glossy_objects_reflect_their_albedo(
    device: ComputeDevice, name: Any, own: dict[str, str]
) -> None:
    material = Material(name, (0.9, 0.6, 0.3), alpha=0.3)
    frame, aim = furnace("sphere"), lamps(furnace("sphere"))
    with kernels(device, frame, [box_of(material)], WAYS[0], aim_at=aim, view=LOOK, own=own) as run:
        runs = [run.reflected(seed, 32) for seed in range(RUNS)]
        inside, wanted = box_truth(run, material)
    for kind in runs[0]:
        confirm(np.array([one[kind][inside, 0] for one in runs]), wanted[kind], rounding=1e-3)


@pytest.mark.thorough
def test_both_methods_have_one_mean(device: ComputeDevice) -> None:
    """Both trace the same paths in each pixel; the terms that one omits cancel in the other."""
    frame, objects = windowed(), [ball(*BALL, LAMP), box_of(Material(albedo=(0.3, 0.6, 0.9)))]
    found = []
    for estimator in ("dpt, aimed", "pt-diff, aimed"):
        with kernels(device, frame, objects, estimator, own=ALL) as run:
            found.append(run.parts(3, 16))
    assert found[0].max() > 0.05
    np.testing.assert_allclose(*found, atol=1e-5 * found[0].max())


# Samples, plane, pictures ----------------------------------------------------------------------


def test_samples_of_the_environment_follow_its_table(device: ComputeDevice) -> None:
    """Every cell has its share of them, and they lie in it."""
    frame = furnace("sphere")
    with kernels(device, frame, [ball(*BALL, LAMP)], "dpt, aimed", aim_at=lamps(frame)) as run:
        lights = run.renderer.world.real.lights
        environment = Environment(device)
        environment.sample(lights)
        given = environment.arguments()
        samples = device.read(given.samples).astype(np.float64)
        density = light_density(device.read(lights.luminance).astype(np.float64))
    rows, columns = lights.rows, lights.columns
    assert given.count == len(samples) == rows * columns
    azimuth = np.arctan2(samples[:, 1], samples[:, 0]) % (2.0 * np.pi)
    column = np.floor(azimuth / (2.0 * np.pi) * columns).astype(int)
    middle = np.arccos(0.5 * (samples[:, 2] + samples[:, 3])) / np.pi
    row = np.floor(middle * rows).astype(int)
    found = np.bincount(row * columns + column, minlength=rows * columns) / len(samples)
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    solid = (edges[:-1] - edges[1:]) * 2.0 * np.pi / columns
    wanted = (density * solid[:, None]).ravel()
    assert set(np.flatnonzero(wanted)) == set(row * columns + column)
    np.testing.assert_allclose(found, wanted, atol=2.0 / len(samples))
    np.testing.assert_allclose(samples[:, 2], edges[row], atol=1e-5)
    np.testing.assert_allclose(samples[:, 3], edges[row + 1], atol=1e-5)


def test_the_plane_is_that_below_the_lowest_object() -> None:
    """A tilted table in a sphere; a second box hangs, and few points tell nothing."""
    normal = np.array([0.1, 1.0, -0.2]) / np.sqrt(1.05)
    directions = View(256, 128, projection="equirect").directions()
    towards = directions @ normal
    with np.errstate(divide="ignore"):
        to_table = np.where(towards < 0.0, -0.8 / np.minimum(towards, -1e-9), np.inf)
    depth = np.minimum(to_table, 5.0).astype(np.float32)
    foot = np.array([0.3, 0.0, -0.9])
    foot[1] = (-0.8 - normal[[0, 2]] @ foot[[0, 2]]) / normal[1]
    standing = np.zeros((2, 4))
    standing[:, :3] = foot + np.array([[-0.2, 0.0, -0.2], [0.2, 0.4, 0.2]])
    bounds = np.stack([standing, standing]).astype(np.float32)
    bounds[0, :, 1] += 0.7
    np.testing.assert_allclose(support_plane(depth, bounds), [*normal, -0.8], atol=1e-5)
    far = np.full_like(depth, 50.0)
    np.testing.assert_allclose(support_plane(far, bounds), [0.0, 1.0, 0.0, foot[1]], atol=1e-6)


@pytest.mark.thorough
def test_all_bounces_are_those_of_iprt(device: ComputeDevice) -> None:
    """Two implementations of one transport, in a picture of objects that light each other."""
    view = View(48, 36, pitch_deg=-35.0)
    objects = [ball(BALL[0], BALL[1], BLACK), box_of(Material(albedo=(0.5, 0.4, 0.3)))]
    rays = {"fading": 0.0, "atrous": {"levels": 0}, "mask": {"sparse": False}}
    trace = {"rays": 16, "object_rays": 16, "jitter": False, "background": False}
    pictures = []
    for chosen in (
        {"method": "dpt", "dpt": {"surfaces": "all", "bounces": 10}},
        {"method": "iprt", "iprt": {"relight_reflections": False}},
    ):
        settings = Settings.model_validate({**rays, "trace": trace, **chosen})
        pictures.append(render(device, windowed(), objects, view, settings, 24).color)
    ours, theirs = pictures
    assert np.abs(ours - theirs).mean() < 0.02 * theirs.mean()
    assert abs(ours.mean() - theirs.mean()) < 2e-3 * theirs.mean()


@pytest.mark.thorough
def test_a_plane_sends_what_the_camera_saw_of_it(device: ComputeDevice) -> None:
    """A mirror above it shows the point where the reflected ray meets it, not its direction."""
    around = View(256, 128, projection="equirect").directions()
    color = 0.6 + 0.4 * np.sin(6.0 * around) * around[..., ::-1]
    frame = replace(windowed(256, 128), color=color.astype(np.float32))
    mirror = Material("conductor", (0.9, 0.8, 0.7), alpha=0.0)
    with kernels(device, frame, [ball(*BALL, mirror)], "dpt, even", view=LOOK, own=PLANE) as run:
        plane = np.array([*UP, PLAIN], np.float32)
        run.renderer.method.environment.plane = plane
        shown = run.reflected(0, 1)["specular"]
        visible, layout = run.renderer.visible, run.renderer.layout
        normal, depth, coverage = (
            np.moveaxis(layout.interior(device.read(planes)).astype(np.float64), 0, -1)
            for planes in (visible.normal, visible.depth, visible.coverage)
        )
    d = LOOK.directions()
    cosine = -(d * normal).sum(-1, keepdims=True)
    inside = (coverage[..., 0] == 1.0) & (cosine[..., 0] > 0.3)
    wi, point = (d + 2.0 * cosine * normal)[inside], (d * depth)[inside]
    down = wi[:, 1] < -0.05
    assert 20 < down.sum() < len(down) - 20
    t = np.where(down, (PLAIN - point[:, 1]) / np.where(down, wi[:, 1], -1.0), np.inf)
    met = np.where(down[:, None], point + np.where(down, t, 0.0)[:, None] * wi, wi)
    wanted = panorama_at(frame.color.astype(np.float64), met / np.linalg.norm(met, axis=1)[:, None])
    off = np.abs(shown[inside][:, 0] / wanted[:, 0] - mirror.albedo[0])
    flat = np.abs(wi[:, 1]) > 0.1
    assert np.quantile(off[flat], 0.9) < 0.02
    apart = panorama_at(frame.color.astype(np.float64), wi)[down & flat, 0]
    assert np.quantile(np.abs(apart / wanted[down & flat, 0] - 1.0), 0.5) > 0.1
