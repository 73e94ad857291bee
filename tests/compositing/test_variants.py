"""Variants of materials in the visible layer, by OpenGL and by rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.material import Material
from iprt.geometry.variants import Variants
from tests.compositing.test_visibility import VIEWS, Both, Drawn, image, layer_of
from tests.raster.shapes import placed, quad

pytestmark = [pytest.mark.gl, pytest.mark.thorough]

INDEX = (np.indices((4, 8)).sum(axis=0) % 2).astype(np.uint8)
COLORS = np.random.default_rng(3).random((32, 32, 3)).astype(np.float32)
PICTURE = Material("principled", clearcoat=0.5, texture=COLORS)
MAPPED = replace(PICTURE, variants=Variants(("clearcoat",), ((0.0,), (1.0,)), INDEX))


STRIPES = np.repeat((np.arange(256) // 16 % 2)[None, :, None], 256, axis=0)
"""Along v."""


@pytest.mark.parametrize("variants", [False, True])
def test_colors_at_a_grazing_angle_are_means_over_a_pixel(
    device: ComputeDevice, variants: bool
) -> None:
    """Stripes that the width of the pixel's cone along them would blur stay apart."""
    texture = np.broadcast_to(STRIPES, (256, 256, 3)).astype(np.float32)
    material = replace(MAPPED if variants else PICTURE, texture=texture, albedo=(1.0, 1.0, 1.0))
    tilt = replace(VIEWS[0], yaw_deg=0.0, pitch_deg=-82.0).world_from_view
    board = placed(quad((material,)), (0.0, 0.0, -2.0), 1.0, tilt)
    drawn, layer = Drawn(device, VIEWS[0], board), layer_of(device, VIEWS[0], material)
    drawn.run(board, (drawn.visibility(), layer))
    whole = image(device, layer, "coverage") == 1.0
    albedo = image(device, layer, "albedo")[..., 0]
    assert whole.sum() > 50
    assert albedo[whole].std() > 0.32
    assert albedo[whole].mean() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("view", VIEWS, ids=lambda view: view.projection)
def test_rays_show_the_variants_that_opengl_shows(device: ComputeDevice, view: object) -> None:
    """Up to texels beside another one. Ids are of materials, whatever the variant."""
    both = Both(device, view, MAPPED)
    plain = Both(device, view, PICTURE)
    drawn, traced = both.images("variant")
    ids = both.images("id")
    for found, expected in zip(ids, plain.images("id"), strict=True):
        np.testing.assert_array_equal(found, expected)
    # Five materials, then the variants of the picture's.
    assert set(np.unique(drawn[ids[0] == 2])) == {6.0, 7.0}
    assert set(np.unique(traced[ids[1] == 2])) == {6.0, 7.0}
    np.testing.assert_array_equal(drawn[ids[0] != 2], ids[0][ids[0] != 2])
    inside = (ids[0] == 2) & (ids[1] == 2)
    assert (drawn != traced)[inside].mean() < 0.5
    for name in ("albedo", "motion", "coverage", "roughness"):
        for found, expected in zip(both.images(name), plain.images(name), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-5)
