"""Surfaces that let rays pass: cut-out leaves and thin curtains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance
from iprt.renderer import RenderedFrame
from iprt.settings.model import Settings
from tests.meshes import transform
from tests.raster.shapes import quad
from tests.rendering import render
from tests.trace.traced import FLOOR, ROOM
from tests.worlds import ceiling_lamp, room_frame

VIEW = View(96, 72, pitch_deg=-30.0, fov_y_deg=60.0)
BLACK = Material("diffuse", (0.0, 0.0, 0.0))
FLAT = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
"""Turns a square to lie, facing up."""


def hung(material: Material) -> Instance:
    """A square above the floor."""
    return Instance("sheet", quad((material,)), transform(0.5 * FLAT, (0.0, FLOOR + 0.4, -1.6)))


def shown(
    device: ComputeDevice, *objects: Instance, frames: int = 8, **more: object
) -> RenderedFrame:
    settings = Settings.model_validate({"fading": 0.0, "atrous": {"levels": 0}, **more})
    frame = room_frame(ROOM, 128, 64, ceiling_lamp)
    return render(device, frame, list(objects), VIEW, settings, frames)


@pytest.mark.parametrize("cutoff", [0.0, 0.5])
def test_what_all_rays_pass_is_invisible(device: ComputeDevice, cutoff: float) -> None:
    picture = shown(device, hung(replace(BLACK, opacity=0.0, cutoff=cutoff)), frames=1)
    np.testing.assert_array_equal(picture.aovs["coverage"], 0.0)
    np.testing.assert_array_equal(picture.color, picture.aovs["background"])
    np.testing.assert_array_equal(picture.aovs["ratio"], 1.0)


@pytest.mark.parametrize("opacity", [0.3, 0.7])
def test_a_thin_sheet_covers_and_shades_in_proportion(
    device: ComputeDevice, opacity: float
) -> None:
    """A black sheet hides its share of the pixels' rays, and of the light below it."""
    whole = shown(device, hung(BLACK), frames=16)
    thin = shown(device, hung(replace(BLACK, opacity=opacity)), frames=16)
    inside = whole.aovs["coverage"] == 1.0
    assert inside.sum() > 300
    assert thin.aovs["coverage"][inside].mean() == pytest.approx(opacity, abs=0.02)
    beside = whole.aovs["coverage"] == 0.0
    shade = 1.0 - whole.aovs["ratio"][beside]
    assert shade.max() > 0.3
    found = 1.0 - thin.aovs["ratio"][beside]
    assert found.mean() == pytest.approx(opacity * shade.mean(), rel=0.05)


def checkered(cutoff: float) -> Material:
    """Squares that are there and that are not, four by four."""
    y, x = np.indices((64, 64)) // 16
    there = np.where((x + y) % 2, 0.9, 0.1).astype(np.float32)
    white = np.ones((64, 64, 3), np.float32)
    return replace(BLACK, texture=white, opacity_texture=there, cutoff=cutoff)


def test_a_cutoff_makes_sharp_holes(device: ComputeDevice) -> None:
    """The picture is covered where a ray in NumPy meets a square that is there."""
    picture = shown(device, hung(checkered(0.5)), frames=1)
    d = VIEW.directions()
    t = (FLOOR + 0.4) / np.where(d[..., 1] < 0.0, d[..., 1], -1e-9)
    u, v = (t * d[..., 0]) / 1.0 + 0.5, (t * d[..., 2] + 1.6) / -1.0 + 0.5
    x, y = 4.0 * u, 4.0 * (1.0 - v)
    on = (u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0)
    there = on & ((np.floor(x) + np.floor(y)) % 2 == 1)
    # Away from borders between squares, where texels blend.
    clear = (np.abs(x - np.round(x)) > 0.2) & (np.abs(y - np.round(y)) > 0.2)
    coverage = picture.aovs["coverage"]
    assert (on & there & clear).sum() > 60
    np.testing.assert_array_equal(coverage[on & there & clear], 1.0)
    np.testing.assert_array_equal(coverage[on & ~there & clear], 0.0)


def test_half_of_the_light_comes_through_a_chequer(device: ComputeDevice) -> None:
    whole = shown(device, hung(BLACK), frames=16)
    holes = shown(device, hung(checkered(0.5)), frames=16)
    beside = whole.aovs["coverage"] == 0.0
    shade, found = (1.0 - one.aovs["ratio"][beside].mean() for one in (whole, holes))
    assert shade > 0.01
    assert found == pytest.approx(0.5 * shade, rel=0.15)


def test_a_ray_passes_many_holes(device: ComputeDevice) -> None:
    """A ball behind thirty sheets of nothing looks as without them."""
    red = Material("diffuse", (0.8, 0.1, 0.1))
    behind = Instance("square", quad((red,)), transform(0.4, (0.0, -0.4, -1.9)))
    sheets = [
        Instance(f"sheet {i}", quad((replace(BLACK, opacity=0.0),)), transform(0.3, (0, -0.3, z)))
        for i, z in enumerate(np.linspace(-1.8, -0.8, 30))
    ]
    alone, hidden = shown(device, behind), shown(device, behind, *sheets)
    np.testing.assert_array_equal(hidden.aovs["coverage"], alone.aovs["coverage"])
    covered = alone.aovs["coverage"] == 1.0
    np.testing.assert_allclose(hidden.color[covered], alone.color[covered], rtol=0.03)
