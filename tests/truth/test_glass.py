"""Glass in Mitsuba's pictures: absorption in closed form, and the renderer's pictures beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.settings.model import Settings
from tests.oracles.brdf import fresnel
from tests.oracles.worlds import World
from tests.rendering import render
from tests.truth.conftest import sphere_frame
from tests.truth.test_panorama import shot
from tests.worlds import ball, bright_walls, cuboid, room_frame

pytestmark = pytest.mark.mitsuba

CLEAR = Material("dielectric", (1.0, 1.0, 1.0), alpha=0.0, ior=1.5)
MATERIALS = {
    "clear": CLEAR,
    "rough and tinted": replace(CLEAR, alpha=0.2, albedo=(0.9, 0.7, 0.5)),
    "absorbing water": replace(CLEAR, ior=1.33, absorption=(0.5, 2.0, 6.0)),
    "half a mixture": Material("principled", (0.8, 0.4, 0.2), 0.3, transmission=0.5),
    "pane": replace(CLEAR, thin=True, albedo=(0.5, 0.9, 0.9)),
}
VIEW = View(32, 32, pitch_deg=-25.0, fov_y_deg=40.0)


def test_a_ball_absorbs_by_beer_and_lambert(mi: Any) -> None:
    """R + (1 - R)² a / (1 - R a) in constant light, where a belongs to the chord."""
    from iprt.truth.model import load_scene, render_color
    from iprt.truth.shapes import instance_shapes

    absorption, radius, distance = np.array([0.0, 1.0, 8.0]), 0.4, 2.0
    glass = replace(CLEAR, absorption=tuple(absorption))
    view = View(24, 24, fov_y_deg=20.0)
    frame = sphere_frame(np.full((32, 64, 3), 1.0, np.float32), 40.0)
    body = ball((0.0, 0.0, -distance), radius, glass)
    found = shot(frame, [body], view, 512).objects
    sky = {"sky": {"type": "constant", "radiance": 1.0}}
    modelled = load_scene({**sky, **instance_shapes([body])})
    other = render_color(modelled, view, spp=512, seed=0, clean=False)
    beside = distance * np.sqrt(1.0 - view.directions()[..., 2] ** 2) / radius
    well = beside < 0.9
    cosine = np.sqrt(1.0 - beside[well] ** 2)
    inner = np.sqrt(1.0 - (beside[well] / glass.ior) ** 2)
    once = fresnel(cosine, glass.ior)[:, None]
    passed = np.exp(-2.0 * radius * inner[:, None] * absorption)
    expected = once + (1.0 - once) ** 2 * passed / (1.0 - once * passed)
    for picture in (found, other):
        np.testing.assert_allclose(picture[well].mean(0), expected.mean(0), rtol=5e-3, atol=1e-3)


def body(name: str) -> Instance:
    material = MATERIALS[name]
    if material.thin:
        return cuboid((0.0, -0.6, -1.3), (0.3, 0.25, 0.005), material)
    return ball((0.0, -0.6, -1.3), 0.3, material, subdivisions=5)


@pytest.mark.parametrize("name", MATERIALS)
def test_pictures_agree(mi: Any, device: ComputeDevice, name: str) -> None:
    """The glass itself, and the light and shadow that it casts on the floor."""
    frame, glass = room_frame(World(), 256, 128, bright_walls), body(name)
    truth = shot(frame, [glass], VIEW, 512)
    settings = Settings.model_validate({"fading": 0.0, "atrous": {"levels": 0}, "gbuffer": "cl"})
    found = render(device, frame, [glass], VIEW, settings, 32)
    inside, outside = truth.coverage == 1.0, truth.coverage == 0.0
    assert inside.sum() > 60
    apart = np.abs(found.color - truth.color)
    assert apart[inside].mean() < 0.07 * truth.color[inside].mean()
    mean, wanted = found.color[inside].mean(0), truth.color[inside].mean(0)
    np.testing.assert_allclose(mean, wanted, rtol=0.015, atol=0.003)
    # Beside it, the real surfaces have the same shadow and light.
    beside = apart[outside] / truth.color[outside]
    assert beside.mean() < 0.025
    assert np.percentile(beside, 98) < 0.12
