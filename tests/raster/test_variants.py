"""Maps of variants in the rasterized layers."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.geometry.sampler import Sampler, Wrap
from iprt.geometry.variants import Variants
from tests.kernels.test_textures import texel
from tests.raster.shapes import placed, quad, rasterizer

pytestmark = pytest.mark.gl

VIEW = View(90, 70, fov_y_deg=30.0)
INDEX = np.random.default_rng(4).integers(0, 5, (4, 6)).astype(np.uint8)
VALUES = tuple((0.2 * number,) for number in range(5))


@pytest.mark.parametrize("wrap", get_args(Wrap))
@pytest.mark.parametrize("textured", [False, True])
def test_the_material_is_that_of_the_nearest_texel(wrap: Wrap, textured: bool) -> None:
    """Colors are the material's own, and it moves with its object."""
    variants = Variants(("clearcoat",), VALUES, INDEX, Sampler((wrap, "repeat")))
    color = np.full((2, 2, 3), 0.5, np.float32) if textured else None
    plain = Material("principled", (0.2, 0.4, 0.8), clearcoat=0.5, texture=color)
    beside = placed(quad((replace(plain, texture=np.ones((1, 1, 3), np.float32)),)), (2.2, 0, -4))
    square = quad((replace(plain, variants=variants),))
    square = replace(square, uvs=3.0 * square.uvs - 1.0)
    here, there = (placed(square, (x, 0.0, -4.0)) for x in (0.0, 0.1))
    with rasterizer([beside, there]) as opened:
        opened.move([beside, here])
        layers = opened.render(VIEW, shade=True, back=False)
        np.testing.assert_array_equal(opened.material_object, [0, 1, 1, 1, 1, 1, 1])
    d = VIEW.directions()
    x, y = -4.0 * d[..., 0] / d[..., 2], -4.0 * d[..., 1] / d[..., 2]
    at = np.stack([(1.5 * x + 0.5) * 6, (0.5 - 1.5 * y) * 4], axis=-1)
    seen = (np.maximum(np.abs(x), np.abs(y)) < 0.98) & (np.abs(at % 1 - 0.5) < 0.4).all(axis=-1)
    assert seen.sum() > 500
    column, row = np.floor(at[seen]).astype(int).T
    wanted = INDEX[texel(row, 4, "repeat"), texel(column, 6, wrap)]
    material = layers.front.material[seen]
    np.testing.assert_array_equal(material[:, 3], 1 + 2 + wanted)
    albedo = np.array([0.2, 0.4, 0.8]) * (0.5 if textured else 1.0)
    np.testing.assert_allclose(material[:, :3], np.tile(albedo, (len(material), 1)), atol=1e-3)
    assert layers.motion is not None
    pixel = np.stack(np.meshgrid(np.arange(90) + 0.5, np.arange(70) + 0.5), axis=-1)[seen]
    step = layers.motion[seen] - pixel
    np.testing.assert_allclose(
        step, np.tile([0.1 * VIEW.focal_px / 4.0, 0.0], (len(step), 1)), atol=0.01
    )
    assert (layers.front.material[..., 3][x > 1.25] == 1).any()
