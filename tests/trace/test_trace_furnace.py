"""White furnaces: virtual surfaces show their albedo, real ones are lit evenly."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.renderer import RenderedFrame
from tests.oracles.brdf import diffuse_albedo, specular_albedo
from tests.oracles.worlds import Sphere
from tests.rendering import render
from tests.trace.traced import (
    BLACK,
    MIRROR,
    mirror_rays,
    settings,
)
from tests.worlds import ball, sphere_frame

RADIANCE = 0.7
BALL = Sphere((0.3, -0.2, -1.0), 0.35)
FURNACE_VIEWS = [View(64, 48), View(128, 64, projection="equirect")]


def furnace(
    device: ComputeDevice, material: Material, view: View, frames: int, estimator: str = "delta"
) -> tuple[RenderedFrame, NDArray[np.bool_]]:
    frame = sphere_frame(2.0, 128, 64, RADIANCE)
    objects = [ball(BALL.centre, BALL.radius, material)]
    picture = render(device, frame, objects, view, settings(estimator=estimator), frames)
    inside = picture.aovs["coverage"] == 1.0
    assert inside.sum() > 80
    return picture, inside


@pytest.mark.parametrize("view", FURNACE_VIEWS, ids=lambda view: view.projection)
@pytest.mark.parametrize(
    "material",
    [Material(albedo=(0.8, 0.5, 0.2)), MIRROR],
    ids=["diffuse", "mirror"],
)
def test_furnace_shows_the_reflectance(
    device: ComputeDevice, material: Material, view: View
) -> None:
    """In even light an object shows its albedo: no ray meets the object itself."""
    picture, inside = furnace(device, material, view, frames=2)
    np.testing.assert_allclose(
        picture.color[inside], np.tile(RADIANCE * np.array(material.albedo), (inside.sum(), 1)),
        rtol=1e-5,
    )  # fmt: skip


@pytest.mark.parametrize("estimator", ["delta", pytest.param("ratio", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("view", FURNACE_VIEWS, ids=lambda view: view.projection)
def test_furnace_lights_real_surfaces_evenly(
    device: ComputeDevice, view: View, estimator: str
) -> None:
    picture, _ = furnace(device, BLACK, view, 3, estimator)
    irradiance = picture.aovs["irradiance_real"]
    if estimator == "delta":  # known where an object matters
        known = irradiance[..., 0] > 0.0
        assert known[picture.aovs["ratio"].min(-1) < 0.99].all()
        assert known.mean() > 0.2
        irradiance = irradiance[known]
    np.testing.assert_allclose(irradiance, RADIANCE, rtol=2e-6)
    assert picture.aovs["irradiance_mixed"].max() <= RADIANCE * (1.0 + 2e-6)


@pytest.mark.parametrize(
    "material",
    [
        pytest.param(Material("conductor", (0.9, 0.6, 0.3), alpha=0.3), marks=pytest.mark.thorough),
        Material("plastic", (0.8, 0.5, 0.2), alpha=0.2),
        Material("principled", (0.8, 0.5, 0.2), alpha=0.3, metallic=0.6),
    ],
    ids=["conductor", "plastic", "principled"],
)
def test_furnace_loses_what_the_brdf_loses(device: ComputeDevice, material: Material) -> None:
    """Radiance by viewing angle is the albedo by quadrature, and never more than the furnace's."""
    view = FURNACE_VIEWS[0]
    picture, inside = furnace(device, material, view, frames=48)
    cosine = mirror_rays(view, BALL)[2]
    for low, high in ((0.3, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1.0)):
        ring = inside & (cosine > low) & (cosine < high)
        mid = float(cosine[ring].mean())
        o = np.array([np.sqrt(1.0 - mid * mid), 0.0, mid])
        albedo = specular_albedo(material, o)
        if material.kind != "conductor":
            base = (1.0 - material.metallic) * np.array(material.albedo)
            albedo = albedo + base * diffuse_albedo(material, o)
        shown = picture.color[ring].mean(0) / RADIANCE
        np.testing.assert_allclose(shown, albedo, rtol=0.02)
        assert (shown < 1.0).all()
