"""Environment mapping: the panorama as a distant environment, which objects alone hide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.oracles.worlds import Sphere
from tests.rendering import render
from tests.trace.closed_forms import (
    BALL,
    BLACK,
    LAMP,
    RUNS,
    as_large,
    ball_factor,
    box_of,
    confirm_ball,
)
from tests.trace.environments import CLAY, UP, hidden_and_bounced, windowed
from tests.trace.estimators import VIEW, Around, Estimator, confirm, furnace, kernels, lamps
from tests.variants import as_traced
from tests.worlds import ball

RAYS = 32
WAYS: tuple[Estimator, ...] = ("em, aimed", "em, even")


# Real surfaces -------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("estimator", "around"), [*((way, "plain") for way in WAYS), (WAYS[0], "sphere")]
)
def test_a_ball_takes_its_form_factor(
    device: ComputeDevice, estimator: Estimator, around: Around
) -> None:
    """Under an even environment, whatever is aimed at."""
    frame, objects = furnace(around), [ball(*BALL, LAMP)]
    with kernels(device, frame, objects, estimator, aim_at=lamps(frame)) as run:
        confirm_ball(run, objects[0], RAYS)


@pytest.mark.thorough
@pytest.mark.parametrize("estimator", WAYS)
def test_a_window_casts_a_shadow_by_its_direction(
    device: ComputeDevice, estimator: Estimator
) -> None:
    frame, albedo = windowed(), np.array([0.9, 0.5, 0.1])
    objects = [ball(*BALL, Material(albedo=tuple(albedo)), subdivisions=5)]
    # The truth of a pixel takes long, so there are few of them.
    view = replace(VIEW, width=VIEW.width // 4, height=VIEW.height // 4)
    with kernels(device, frame, objects, estimator, view=view) as run:
        points, normals = (at.reshape(-1, 3) for at in run.receivers())
        wanted = hidden_and_bounced(frame, points, normals, Sphere(*BALL), albedo)
        parts = np.array([run.parts(seed, 24 * RAYS) for seed in range(RUNS)])
    for part in (0, 1):
        found = parts[..., part, 0].reshape(RUNS, -1)
        confirm(found, wanted[part][:, 0], rounding=5e-3)
    assert wanted[0].max() > 2.0 * np.median(wanted[0])  # the window's shadow


# Objects -------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("estimator", WAYS)
def test_objects_shade_each_other(device: ComputeDevice, estimator: Estimator) -> None:
    """A box's top below a black ball, in a furnace: 1 - (r / d)² cos β."""
    hung, radius = (0.35, -0.15, -1.2), 0.15
    box, black = box_of(Material(albedo=(1.0, 1.0, 1.0))), ball(hung, radius, BLACK)
    view = View(40, 30, pitch_deg=-38.0, fov_y_deg=60.0)
    frame = furnace("sphere")
    with kernels(device, frame, [box, black], estimator, aim_at=lamps(frame), view=view) as run:
        visible, layout = run.renderer.visible, run.renderer.layout
        normal, depth = (
            np.moveaxis(layout.interior(device.read(planes)).astype(np.float64), 0, -1)
            for planes in (visible.normal, visible.depth)
        )
        top = normal[..., 1] > 1.0 - 1e-4
        points = (view.directions() * depth)[top]
        runs = np.array([run.reflected(seed, RAYS)["diffuse"][top, 0] for seed in range(RUNS)])
    factor = ball_factor(points, np.broadcast_to(UP, points.shape), hung, as_large(black, radius))
    assert factor.max() > 0.1
    confirm(runs, 1.0 - factor, rounding=1e-3)


# What it sees, and what it does not --------------------------------------------------------


def test_without_visibility_it_is_image_based_lighting(device: ComputeDevice) -> None:
    objects = [ball(*BALL, CLAY), ball((-0.4, -0.9, -1.0), 0.3, Material("plastic", alpha=0.2))]
    view = View(48, 36, pitch_deg=-35.0)
    of = {"trace": {"object_rays": 4}}
    without = as_traced("em", em={"visibility": False}, **of)
    off = render(device, windowed(), objects, view, without, 2)
    ibl = without.model_copy(update={"method": "ibl"})
    np.testing.assert_array_equal(
        off.color, render(device, windowed(), objects, view, ibl, 2).color
    )
    beside = off.aovs["coverage"] == 0.0
    empty = render(device, windowed(), [], view, without, 2)
    np.testing.assert_array_equal(off.color[beside], empty.color[beside])


def test_a_convex_object_is_lit_as_by_image_based_lighting(device: ComputeDevice) -> None:
    view = View(48, 36, pitch_deg=-35.0)
    rays = as_traced("em", trace={"object_rays": 64, "jitter": False})
    without = rays.model_copy(update={"method": "ibl"})
    tested, untested = (
        render(device, windowed(), [ball(*BALL, CLAY)], view, chosen, 16)
        for chosen in (rays, without)
    )
    inside = tested.aovs["coverage"] == 1.0
    assert inside.sum() > 150
    apart = tested.color[inside] - untested.color[inside]
    scale = untested.color[inside].mean()
    assert np.abs(apart.mean(0)).max() < 5e-3 * scale
    assert np.abs(apart).mean() < 0.03 * scale
    assert tested.aovs["ratio"].min() < 0.8
