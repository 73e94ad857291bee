"""Footprints of rays on textured triangles, and the level that follows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.bvh.scene import object_bounds
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material
from iprt.settings.features import BVH_DEFINES
from iprt.world.objects.object_bvh import ObjectBvh
from tests.kernels.wrap import evaluate
from tests.raster.shapes import placed, quad

Float = NDArray[np.float64]
CHECKS = np.repeat((np.indices((128, 64)).sum(axis=0) % 2)[..., None], 3, 2).astype(np.float32)
WHITE = (1.0, 1.0, 1.0)
DEFINES = (*(f"{name}={value}" for name, value in BVH_DEFINES.items()), "TEXTURES")
SIZES = (1.5, 0.4)
"""Half the sides of the square."""


def met(
    device: ComputeDevice, d: Float, cone: tuple[float, float], degrees: float
) -> dict[str, NDArray[Any]]:
    """What rays from the origin find on a square about (0, 0, -3), turned about x."""
    turn = np.radians(degrees)
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    shape = quad((Material(albedo=WHITE, texture=CHECKS),))
    square = placed(shape, (0.0, 0.0, -3.0), (*SIZES, 1.0), rotation)
    bvh = ObjectBvh(device, [square])
    bvh.load([square])
    boxes = device.upload("boxes", object_bounds([square], margin=1e-3))
    body = """
        ObjectHit hit;
        footprint = number = -1.0f;
        albedo = (float3)(0.0f);
        if (trace_objects(world, (float3)(0.0f), d, INFINITY, 0, &hit)) {
            const RayCone cone = {width, spread};
            const ObjectSurface at = object_surface(world, hit, d, cone);
            footprint = at.footprint;
            number = level_number((int2)(64, 128), footprint);
            albedo = object_albedo(world, at);
        }"""
    width, spread = (np.full(len(d), value, np.float32) for value in cone)
    return evaluate(
        device,
        ["world/objects/objects.h"],
        body,
        {"d": d.astype(np.float32), "width": width, "spread": spread},
        {"footprint": "float", "number": "float", "albedo": "float3"},
        defines=DEFINES,
        parameters="const Objects world",
        arguments={"world": bvh.arguments(boxes)},
    )


@pytest.mark.parametrize("degrees", [0.0, 60.0, 80.0])
@pytest.mark.parametrize("cone", [(0.0, 0.004), (0.03, 0.002)])
def test_the_level_is_the_footprint_in_texels(
    device: ComputeDevice, degrees: float, cone: tuple[float, float]
) -> None:
    """On a plane: the cone's width over the cosine, over the side of a texel of the same area."""
    d = View(40, 30, fov_y_deg=16.0).directions().reshape(-1, 3).astype(np.float64)
    found = met(device, d, cone, degrees)
    normal = np.array([0.0, -np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
    t = -3.0 * normal[2] / (d @ normal)
    width = (cone[0] + cone[1] * t) / np.abs(d @ normal)
    texel = np.sqrt(4.0 * SIZES[0] * SIZES[1] / (64 * 128))
    seen = found["footprint"] > 0.0
    assert seen.sum() > 60
    wanted = np.maximum(np.log2(width / texel), 0.0)[seen]
    assert degrees == 0.0 or np.ptp(wanted) > 0.002
    np.testing.assert_allclose(found["number"][seen], wanted, atol=2e-3)
    uv = width / np.sqrt(4.0 * SIZES[0] * SIZES[1])
    np.testing.assert_allclose(found["footprint"][seen], uv[seen], rtol=1e-4)


def test_a_far_checker_shows_its_mean_in_each_ray(device: ComputeDevice) -> None:
    d = View(40, 30, fov_y_deg=10.0).directions().reshape(-1, 3).astype(np.float64)
    fine = met(device, d, (0.0, 0.0), 30.0)["albedo"]
    assert fine.std() > 0.15
    far = met(device, d, (0.0, 0.05), 30.0)["albedo"]
    np.testing.assert_allclose(far, 0.5, atol=0.01)


def test_lobes_widen_rays(device: ComputeDevice) -> None:
    """The solid angle of sixteen rays is that of the lobe; mirrors add nothing."""
    density = np.float32([1.0 / (2.0 * np.pi), 100.0, 0.0, 0.0])
    alpha = np.float32([0.5, 0.5, 0.0, 0.1])
    body = """
        const RayCone before = {0.02f, 0.003f};
        const RayCone after = scattered_cone(before, 2.0f, density, alpha);
        width = after.width;
        spread = after.spread;"""
    found = evaluate(
        device,
        ["world/objects/ray_cone.h"],
        body,
        {"density": density, "alpha": alpha},
        {"width": "float", "spread": "float"},
    )
    np.testing.assert_allclose(found["width"], 0.026, rtol=1e-5)
    lobes = np.sqrt([2.0 * np.pi / 16.0, 0.01 / 16.0, 0.0, 4.0 * np.pi * 0.01 / 16.0])
    np.testing.assert_allclose(found["spread"], 0.003 + lobes, rtol=1e-5)
