"""Textures finer than pixels, in the view and in reflections, while the head turns a little."""

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
from tests.raster.shapes import placed, quad
from tests.rendering import render
from tests.worlds import Float, sphere_frame

VIEW = View(40, 30, fov_y_deg=12.0)
CHECKS = np.repeat((np.indices((1024, 1024)).sum(axis=0) % 2)[..., None], 3, 2).astype(np.float32)
WHITE = (1.0, 1.0, 1.0)
AROUND = np.diag([-1.0, 1.0, -1.0])
BOARD = Material(albedo=WHITE, texture=CHECKS)


def seen(material: Material, metal: Material | None) -> list[Instance]:
    """A board in front, or behind and in a metal."""
    shape = quad((material,))
    if metal is None:
        return [placed(shape, (0.0, 0.0, -3.0), 1.0)]
    reflector = placed(quad((metal,)), (0.0, 0.0, -1.5), 0.5, name="metal")
    return [reflector, placed(shape, (0.0, 0.0, 1.5), 1.5, AROUND)]


def shown(device: ComputeDevice, objects: list[Instance], view: View, **more: Any) -> Float:
    """A single frame in even light."""
    settings = Settings.model_validate(
        {"gbuffer": "cl", "fading": 0.0, "atrous": {"levels": 0}, **more}
    )
    picture = render(device, sphere_frame(4.0, 64, 32, 1.0), objects, view, settings)
    assert (picture.aovs["coverage"] == 1.0).all()
    return picture.color.astype(np.float64)


METALS = {
    "view": None,
    "mirror": Material("conductor", WHITE, alpha=0.0),
    "rough metal": Material("conductor", WHITE, alpha=0.1),
}
PATHS = {"method": "pt-diff"}


@pytest.mark.parametrize("name", METALS)
@pytest.mark.parametrize("method", [{}, PATHS], ids=["rays", "paths"])
def test_a_fine_checker_looks_like_its_mean(
    device: ComputeDevice, name: str, method: dict[str, Any]
) -> None:
    """As a grey board does, also after a turn of the head by half a pixel."""
    metal, grey = METALS[name], replace(BOARD, albedo=(0.5, 0.5, 0.5), texture=None)
    half = np.degrees(0.5 * VIEW.pixel_angle)
    errors = []
    for view in (VIEW, replace(VIEW, yaw_deg=half, pitch_deg=0.6 * half)):
        checker, plain = (shown(device, seen(one, metal), view, **method) for one in (BOARD, grey))
        errors.append(((checker - plain) / plain.mean())[4:-4, 4:-4])
    assert np.abs(errors).max() < 0.01
