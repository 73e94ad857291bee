"""Normals of clear coats as the view has them, drawn by rays and by OpenGL."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from tests.compositing.test_visibility import drawn_and_traced, image, views
from tests.kernels.wrap import evaluate
from tests.oracles.brdf import normalized
from tests.raster.shapes import placed, quad
from tests.worlds import Float

pytestmark = pytest.mark.gl


@views
@pytest.mark.parametrize("above", [None, (-0.3, 0.2, 0.9)])
@pytest.mark.parametrize("behind", [False, True])
def test_normals_of_clear_coats(
    device: ComputeDevice, view: View, above: tuple[float, float, float] | None, behind: bool
) -> None:
    """They follow maps of their own, turned to the viewer; drawn ones follow the map below."""
    below = np.tile(np.float32([0.3, 0.5, 0.8]), (4, 4, 1))
    own = None if above is None else np.tile(np.float32(above), (4, 4, 1))
    material = Material("principled", normal_texture=below, clearcoat=1.0)
    material = replace(material, clearcoat_normal_texture=own)
    along_u = np.tile([1.0, 0.0, 0.0, 1.0], (4, 1)).astype(np.float32)
    square = replace(quad((material,)), tangents=along_u)
    side = -1.0 if behind else 1.0
    turn = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]) * [side, 1.0, side]
    coat = turn @ normalized(np.array([0.0, 0.0, 1.0] if above is None else above))
    drawn, traced = drawn_and_traced(device, view, placed(square, (-0.2, 0.0, -1.5), 0.5, turn))
    for layer in (drawn, traced):
        seen = image(device, layer, "coverage") == 1.0
        assert seen.sum() > 200
        n, d = image(device, layer, "normal")[seen], view.directions()[seen]
        found = unpacked(device, n, image(device, layer, "coat_normal")[seen])
        facing = side * coat
        turned = facing - 2.0 * np.maximum(d @ facing, 0.0)[:, None] * d
        np.testing.assert_allclose(found, n if layer is drawn else turned, atol=1e-4)


def unpacked(device: ComputeDevice, n: Float, packed: Float) -> Float:
    """Return normals of clear coats, (N, 3), beside the surface's."""
    body = "coat = frame_to_world(build_frame(n), unpacked_coat_normal(packed));"
    inputs = {"n": np.float32(n), "packed": np.float32(packed)}
    outputs = {"coat": "float3"}
    found = evaluate(device, ["world/finish.h"], body, inputs, outputs, None, ("COAT_NORMALS",))
    return np.asarray(found["coat"], np.float64)
