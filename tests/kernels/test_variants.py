"""Maps of variants as rays read them: texels drawn at random, with the mean of the filtered map."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.bvh.scene import object_bounds
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material import Material, material_table
from iprt.geometry.sampler import PLAIN, Sampler
from iprt.geometry.variants import Variants
from iprt.settings.features import BVH_DEFINES
from iprt.world.objects.object_bvh import ObjectBvh
from iprt.world.objects.texture_tables import texture_table, variant_table
from tests.kernels.test_textures import WRAPS, expected
from tests.kernels.wrap import evaluate
from tests.raster.shapes import placed, quad

Float = NDArray[np.float64]
INDEX = np.random.default_rng(4).integers(0, 5, (5, 3)).astype(np.uint8)
VALUES = tuple((0.1 + 0.2 * number,) for number in range(5))
BASE = Material("principled", clearcoat=0.5)
DRAWS = 64
"""Random numbers along either side of a grid of them."""


def mapped(sampler: Sampler = PLAIN, index: NDArray[np.uint8] = INDEX) -> Material:
    return replace(BASE, variants=Variants(("clearcoat",), VALUES, index, sampler))


def shares(
    device: ComputeDevice, sampler: Sampler, uv: Float, footprint: Float
) -> NDArray[np.float64]:
    """Return the frequency of each variant there, (N, 5)."""
    grid = (np.stack(np.mgrid[0:DRAWS, 0:DRAWS], axis=-1).reshape(-1, 2) + 0.5) / DRAWS
    table, indices = variant_table([BASE, mapped(sampler)])
    found = evaluate(
        device,
        ["world/objects/objects_bvh.h"],
        "index = drawn_index(indices, as_int4(table[1]), uv, footprint, u);",
        {
            "uv": np.repeat(uv, len(grid), axis=0).astype(np.float32),
            "footprint": np.repeat(footprint, len(grid)).astype(np.float32),
            "u": np.tile(grid, (len(uv), 1)).astype(np.float32),
        },
        {"index": "int"},
        {"table": table.view(np.float32)},
        ("OBJECTS_BVH", "BVH_STACK=64", "TEXTURES", "VARIANTS"),
        "__global const uchar *indices",
        {"indices": device.upload("indices", indices)},
    )
    drawn = found["index"].reshape(len(uv), len(grid))
    return np.stack([(drawn == number).mean(axis=1) for number in range(5)], axis=1)


@pytest.mark.parametrize("nearest", [False, True])
@pytest.mark.parametrize("wrap", WRAPS)
def test_draws_have_the_mean_of_the_filtered_map(
    device: ComputeDevice, wrap: Any, nearest: bool
) -> None:
    """The share of a variant is the value of the picture of where it is."""
    sampler = Sampler((wrap, wrap), nearest)
    uv = np.random.default_rng(5).uniform(-1.3, 2.3, (80, 2))
    found = shares(device, sampler, uv, np.zeros(len(uv)))
    for number in range(5):
        picture = np.repeat((number == INDEX)[..., None], 3, axis=2).astype(np.float32)
        wanted = expected(uv, sampler, picture)[:, 0]
        np.testing.assert_allclose(found[:, number], wanted, atol=2.0 / DRAWS)


def test_a_wide_footprint_shows_what_it_covers(device: ComputeDevice) -> None:
    """A whole period of the map, or a third of it, three texels of a row wide."""
    counts = np.bincount(INDEX.ravel(), minlength=5) / INDEX.size
    uv = np.array([[0.31, 0.77]])
    found = shares(device, PLAIN, uv, np.array([1.0]))
    np.testing.assert_allclose(found[0], counts, atol=2.0 / DRAWS)
    half = shares(device, PLAIN, np.array([[0.5, 0.5]]), np.array([0.4]))
    assert np.abs(half[0] - counts).max() > 0.05


def test_rays_meet_the_variant_of_their_texel(device: ComputeDevice) -> None:
    """Away from borders between texels; its colors are read as the material's own are."""
    index = np.repeat(np.arange(4, dtype=np.uint8), 8)[None].repeat(8, axis=0)
    white = np.ones((2, 2, 3), np.float32)
    material = replace(mapped(index=index), texture=white, albedo=(0.2, 0.4, 0.8))
    squares = [
        placed(quad((Material(),)), (0.0, 0.0, 3.0), 1.0),
        placed(quad((material,)), (0.0, 0.0, -3.0), 1.0),
    ]
    bvh = ObjectBvh(device, squares)
    bvh.load(squares)
    boxes = device.upload("boxes", object_bounds(squares, margin=1e-3))
    d = View(60, 50, fov_y_deg=20.0).directions().reshape(-1, 3).astype(np.float32)
    body = """
        ObjectHit hit;
        at = base = -1;
        albedo = (float3)(0.0f);
        if (trace_objects(world, (float3)(0.0f), d, INFINITY, 0, &hit)) {
            const RayCone cone = {0.0f, 0.0f};
            const Scatterer point = object_point(world, hit, (float3)(0.0f), d, cone);
            at = point.material;
            albedo = point.albedo;
            base = without_variant(table, at);
        }"""
    defines = BVH_DEFINES | {"TEXTURES": 1, "VARIANTS": 1, "PRINCIPLED": 1, "COVERED": 1}
    table = material_table([Material(), material])
    found = evaluate(
        device,
        ["world/material.h", "world/objects/objects.h"],
        body,
        {"d": d},
        {"at": "int", "base": "int", "albedo": "float3"},
        {"table": table},
        tuple(f"{name}={int(value)}" for name, value in defines.items()),
        "const Objects world",
        {"world": bvh.arguments(boxes)},
    )
    x = 3.0 * d[:, 0] / -d[:, 2]
    seen = (np.abs(x) < 0.95) & (np.abs(d[:, 1]) < 0.3) & (np.abs((x / 0.5) % 1.0 - 0.5) < 0.3)
    assert seen.sum() > 100
    assert (found["base"][seen] == 1).all()
    np.testing.assert_array_equal(found["at"][seen], 2 + np.floor((x[seen] + 1.0) / 0.5))
    np.testing.assert_allclose(found["albedo"][seen], np.tile([0.2, 0.4, 0.8], (seen.sum(), 1)))


def test_texels_are_in_the_table_once() -> None:
    """The rows of all variants name the same place."""
    material = replace(mapped(), texture=np.ones((4, 4, 3), np.float32))
    table, texels = texture_table([material])
    assert len(texels) == 16 + 4 + 1
    rows = table.reshape(6, -1, 4)
    np.testing.assert_array_equal(rows, np.tile(rows[:1], (6, 1, 1)))
