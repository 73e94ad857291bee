"""Maps of metalness and roughness: each half of a picture looks as its material does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.geometry.sampler import Sampler
from iprt.settings.model import Settings
from tests.meshes import transform
from tests.raster.shapes import quad
from tests.rendering import render
from tests.worlds import Float, sphere_frame

VIEW = View(48, 32, fov_y_deg=40.0)
COLOR = (0.9, 0.5, 0.2)
METAL = Material("principled", COLOR, alpha=0.09, metallic=1.0)
PAINT = Material("principled", COLOR, alpha=0.36, metallic=0.0)
MIXED = Material("principled", COLOR, alpha=0.16, metallic=0.5)


def mapped(left: Material, right: Material) -> Material:
    """Return a material whose left half, in texture coordinates, is one and whose right another."""
    halves = [(one.metallic, np.sqrt(one.alpha)) for one in (left, right)]
    image = np.repeat(np.array(halves, np.float32)[None], 8, axis=1)
    return Material(
        "principled",
        COLOR,
        alpha=1.0,
        metallic=1.0,
        surface_texture=np.ascontiguousarray(np.tile(image, (4, 1, 1))),
        samplers=(Sampler(), Sampler(("clamp", "clamp")), *[Sampler()] * 3),
    )


def shown(device: ComputeDevice, material: Material, **settings: object) -> Float:
    """A tilted square in a room that is bright on one side."""
    color = np.full((32, 64, 3), 0.4, np.float32)
    color[:, 32:] = 1.5
    frame = replace(sphere_frame(3.0, 64, 32, 1.0), color=color)
    turned = np.array([[0.9, 0.0, 0.43], [0.0, 1.0, 0.0], [-0.43, 0.0, 0.9]])
    instance = Instance("square", quad((material,)), transform(0.6 * turned, (0.0, 0.0, -2.0)))
    chosen = Settings.model_validate({"fading": 0.0, "atrous": {"levels": 0}, **settings})
    picture = render(device, frame, [instance], VIEW, chosen, frames=4)
    assert (picture.aovs["coverage"] == 1.0).sum() > 200
    return np.where(picture.aovs["coverage"][..., None] == 1.0, picture.color, np.nan)


SETTINGS = {
    "rays all over pixels": {},
    "rays from centres": {"trace": {"jitter": False}},
    "two bounces": {"trace": {"bounces": 2}},
    "OpenGL": {"gbuffer": "gl"},
    "paths": {"method": "pt-diff"},
    "cones": {"method": "vct"},
    "layers": {"method": "iprt2023"},
    "light at half the resolution": {"light_scale": 2},
}
MARKS = {
    "OpenGL": ["gl"],
    "paths": ["thorough"],
    "cones": ["thorough"],
    "layers": ["gl", "thorough"],
}
"""Thorough: their programs are needed nowhere else."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[getattr(pytest.mark, mark) for mark in MARKS.get(name, ())])
        for name in SETTINGS
    ],
)
def test_each_half_looks_as_its_material(device: ComputeDevice, name: str) -> None:
    whole = shown(device, mapped(METAL, PAINT), **SETTINGS[name])
    metal, paint = (shown(device, one, **SETTINGS[name]) for one in (METAL, PAINT))
    assert np.nanmean(np.abs(metal - paint)) > 0.05
    columns = np.arange(VIEW.width)
    left, right = columns < 21, columns > 26
    for half, expected in ((left, metal), (right, paint)):
        error = (whole - expected)[:, half]
        assert np.isfinite(error).sum() > 300
        assert np.nanmax(np.abs(error)) < 0.02


def test_a_map_of_one_value_is_the_number(device: ComputeDevice) -> None:
    """Also where rays meet the surface in a reflection."""
    plain, textured = shown(device, MIXED), shown(device, mapped(MIXED, MIXED))
    np.testing.assert_allclose(textured, plain, rtol=4e-3)
