"""Delta voxel cone tracing against closed forms: shadows, antiradiance, bounces, reflections."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.kernels.wrap import evaluate
from tests.trace.closed_forms import (
    BALL,
    BLACK,
    LAMP,
    as_large,
    ball_factor,
)
from tests.trace.environments import CLAY
from tests.trace.estimators import PLAIN, furnace, kernels
from tests.trace.test_gloss import BALL as HUNG
from tests.trace.test_gloss import DOWN, floor_rays, mirror_room, render_with_specks
from tests.trace.test_voxels import planes_of
from tests.variants import as_traced
from tests.worlds import Float, ball

COARSE: dict[str, Any] = {"voxels": 32, "room_voxels": 32, "lights": 128}
MANY: dict[str, Any] = {**COARSE, "voxels": 64, "lights": 256}


# Voxels --------------------------------------------------------------------------------------


def test_what_a_lit_ball_sends(device: ComputeDevice) -> None:
    """In a furnace, its albedo, but for what it hides from itself: nothing."""
    with kernels(device, furnace("sphere"), [ball(*BALL, CLAY)], "dvct, even", own=MANY) as run:
        _, light = planes_of(run, run.renderer.method.voxels.objects)
    sends = light[..., 3] > 0.0
    radiance = light[sends][:, :3] / light[sends][:, 3:]
    np.testing.assert_allclose(radiance.mean(0), CLAY.albedo, rtol=0.1)


def test_antiradiance_is_the_shadow(device: ComputeDevice) -> None:
    """Voxels of a plain send less by the form factor of the ball above them, and none more."""
    made = ball(*BALL, BLACK)
    with kernels(device, furnace("plain"), [made], "dvct, even", own=MANY) as run:
        delta = run.renderer.method.voxels.delta
        opacity, light = planes_of(run, delta)
    solid = opacity[..., 0] > 0.0
    assert light[..., :3].max() <= 0.0
    np.testing.assert_array_equal(light[~solid], 0.0)
    centres = delta.grid.low + delta.grid.voxel * (np.stack(np.indices(solid.shape), -1) + 0.5)
    assert abs(centres[solid][:, 1].mean() - PLAIN) < 1.5 * delta.grid.voxel
    points = centres[solid] * [1.0, 0.0, 1.0] + [0.0, PLAIN, 0.0]
    wanted = ball_factor(points, np.array([0.0, 1.0, 0.0]), BALL[0], as_large(made, BALL[1]))
    found = -light[solid][:, 0]
    assert found.mean() == pytest.approx(wanted.mean(), rel=0.1)
    assert np.corrcoef(found, wanted)[0, 1] > 0.97


# Real surfaces -------------------------------------------------------------------------------


@pytest.mark.thorough
def test_shadows_are_form_factors(device: ComputeDevice) -> None:
    """Of a ball above a plain, under an even sky; errors shrink with lights and voxels."""
    made = ball(*BALL, BLACK)
    errors = []
    for own in ({**COARSE, "lights": 8, "voxels": 16}, MANY):
        with kernels(device, furnace("plain"), [made], "dvct, even", own=own) as run:
            points, normals = run.receivers()
            wanted = ball_factor(points, normals, BALL[0], as_large(made, BALL[1]))
            parts = np.mean([run.parts(seed, 64) for seed in range(4)], axis=0)
        np.testing.assert_array_equal(parts[..., 1, :], 0.0)
        hidden = parts[..., 0, 0]
        errors.append(hidden.mean() / wanted.mean() - 1.0)
    assert np.corrcoef(hidden.ravel(), wanted.ravel())[0, 1] > 0.95
    assert abs(errors[1]) < 0.1
    assert abs(errors[1]) < abs(errors[0])


def test_a_small_lamp_casts_a_shadow_with_a_penumbra_of_its_size(device: ComputeDevice) -> None:
    """Under a ball below a lamp of 0.1 rad, at 0.7 m: 0.07 m to either side of the ball's rim."""
    frame = furnace("plain")
    d = View(frame.width, frame.height, projection="equirect").directions()
    lamp = (d[..., 1:2] > np.cos(0.1)) * np.ones(3)
    frame = replace(frame, color=lamp.astype(np.float32))
    own = {**MANY, "lights": 1}
    with kernels(device, frame, [ball(*BALL, BLACK)], "dvct, even", own=own) as run:
        points, _ = run.receivers()
        ratio = np.mean([run.ratio(seed, 8) for seed in range(4)], axis=0)[..., 0]
    away = np.hypot(points[..., 0] - BALL[0][0], points[..., 2] - BALL[0][2])
    inner, outer = (away > 0.3) & (away < 0.36), (away > 0.56) & (away < 0.7)
    assert min(inner.sum(), outer.sum()) > 5
    assert ratio[inner].mean() < 0.05
    assert ratio[outer].mean() > 0.97


def test_a_ball_sends_by_its_form_factor(device: ComputeDevice) -> None:
    """Black in red, and twice as much in blue as in green."""
    made = ball(*BALL, LAMP)
    with kernels(device, furnace("sphere"), [made], "dvct, even", own=MANY) as run:
        points, normals = run.receivers()
        wanted = ball_factor(points, normals, BALL[0], as_large(made, BALL[1]))
        hidden, sent = np.moveaxis(np.mean([run.parts(i, 16) for i in range(4)], axis=0), -2, 0)
    np.testing.assert_array_equal(sent[..., 0], 0.0)
    np.testing.assert_allclose(sent[..., 1].mean(), 0.5 * sent[..., 2].mean(), rtol=1e-3)
    # Nine cones are wide: they smear the ball over its surroundings.
    assert sent[..., 2].mean() == pytest.approx(wanted.mean(), rel=0.25)
    # What its shadow takes from other walls comes on top of what it hides itself.
    assert wanted.mean() * 0.9 < hidden[..., 0].mean() < wanted.mean() * 1.5


# Glossy real surfaces ------------------------------------------------------------------------


def lobes(device: ComputeDevice, material: Material, o: Float) -> tuple[Float, Float, Float]:
    """Direction, weight and solid angle of `mirrored_lobe`, and the lobe's density there."""
    found = evaluate(
        device,
        ["world/brdf.h"],
        """
        const Material material = {KIND_CONDUCTOR, alpha, 1.0f, 0.0f, 0};
        const float3 n = (float3)(0.0f, 0.0f, 1.0f), color = (float3)(1.0f, 0.5f, 0.25f);
        float wide;
        const BrdfSample lobe = mirrored_lobe(material, color, build_frame(n), o, &wide);
        wi = lobe.wi;
        weight = lobe.weight;
        solid_angle = wide;
        density = brdf_pdf(material, color, n, o, lobe.wi).y;
        value = brdf_eval(material, color, n, o, lobe.wi).specular;
        """,
        {"o": o.astype(np.float32), "alpha": np.full(len(o), material.alpha, np.float32)},
        {"wi": "float3", "weight": "float3", "solid_angle": "float", "density": "float",
         "value": "float3"},
    )  # fmt: skip
    density = found["density"].astype(np.float64)
    np.testing.assert_allclose(found["solid_angle"] * density, 1.0, rtol=1e-3)
    wanted = found["value"] * (found["wi"][:, 2] / density)[:, None]
    return found["wi"], found["weight"], wanted


@pytest.mark.parametrize("alpha", [0.05, 0.3, 0.8])
def test_a_lobe_is_a_cone_of_its_density(device: ComputeDevice, alpha: float) -> None:
    """Its weight is f cos / density, its solid angle the inverse of that density."""
    o = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, -0.8, 0.6], [0.9, 0.3, 0.316]])
    o /= np.linalg.norm(o, axis=1, keepdims=True)
    wi, weight, wanted = lobes(device, Material("conductor", alpha=alpha), o)
    np.testing.assert_allclose(wi, o * [-1.0, -1.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(weight, wanted, rtol=2e-3)


@pytest.mark.thorough
def test_a_mirror_floor_shows_the_ball_upside_down(device: ComputeDevice) -> None:
    """A black ball hides what was reflected, as voxels do; far beside its image nothing changes."""
    chosen = as_traced("dvct", dvct={**COARSE, "voxels": 64})
    picture = render_with_specks(
        device, mirror_room(), [ball(HUNG.centre, HUNG.radius, BLACK)], chosen=chosen
    )
    seen, points, mirrored = floor_rays(DOWN)
    enter, leave, _, _ = HUNG.interval(points, mirrored)
    depth = np.where(leave > enter, leave - enter, 0.0)
    hidden = seen & (depth > 1.2 * HUNG.radius) & (enter > 0.0)
    background = picture.aovs["background"]
    mirror = (picture.aovs["highlight"] == background).all(-1)
    hidden &= mirror & (picture.aovs["coverage"] == 0.0)
    assert hidden.sum() > 50
    shown = (picture.color[hidden] / background[hidden]).mean()
    assert shown < 0.1
