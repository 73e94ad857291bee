"""Maps that lie elsewhere than the color: rays read them as if they were laid by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from iprt.bvh.scene import object_bounds
from iprt.device.compute import ComputeDevice
from iprt.geometry.camera import View
from iprt.geometry.material_needs import MaterialNeeds
from iprt.geometry.mesh import Mesh
from iprt.geometry.place import Place, relative
from iprt.settings.features import BVH_DEFINES
from iprt.world.objects.object_bvh import ObjectBvh
from tests.kernels.test_textures import expected
from tests.kernels.wrap import evaluate
from tests.placed_maps import ALIKE, PLACED, PLACES, placed_square, square_by_hand, waves
from tests.raster.shapes import placed, quad

SHIFTED = (0.3, -0.1, -3.0)
MAPS = ("finish", "normal", "emission")
BODY = """
    ObjectHit hit;
    finish = (float2)(-1.0f);
    normal = coat_normal = emission = (float3)(0.0f);
    uv = (float2)(0.0f);
    if (trace_objects(world, (float3)(0.0f), d, INFINITY, 0, &hit)) {
        const RayCone cone = {0.0f, spread};
        const ObjectSurface at = object_surface(world, hit, d, cone);
        finish = object_finish(world, at);
        emission = object_emission(world, at);
        normal = at.normal;
#ifdef COAT_NORMALS
        coat_normal = at.coat_normal;
#endif
        uv = object_uv(world.bvh.uvs, at.vertices, at.weights);
    }"""


def met(device: ComputeDevice, shape: Mesh, spread: float) -> dict[str, NDArray[Any]]:
    """Return the hits of rays of this spread on a square, beside squares of plain materials."""
    squares = [placed(quad(), (0.0, 0.0, 3.0)), placed(shape, SHIFTED)]
    bvh = ObjectBvh(device, squares)
    bvh.load(squares)
    boxes = device.upload("boxes", object_bounds(squares, margin=1e-3))
    d = View(60, 50, fov_y_deg=30.0).directions().reshape(-1, 3).astype(np.float32)
    defines = BVH_DEFINES | MaterialNeeds.of(shape.materials).defines()
    return evaluate(
        device,
        ["world/objects/objects.h"],
        BODY,
        {"d": d, "spread": np.full(len(d), spread, np.float32)},
        {"finish": "float2", "uv": "float2"}
        | dict.fromkeys(("normal", "coat_normal", "emission"), "float3"),
        defines=tuple(f"{name}={int(value)}" for name, value in defines.items() if value),
        parameters="const Objects world",
        arguments={"world": bvh.arguments(boxes)},
    )


@pytest.mark.thorough
@pytest.mark.parametrize("spread", [0.0, 0.01, 0.06])
def test_rays_read_each_map_at_its_place(device: ComputeDevice, spread: float) -> None:
    """At the finest level, and at those of wide footprints."""
    found = met(device, placed_square(), spread)
    seen = found["finish"][:, 0] >= 0.0
    assert seen.sum() > 500
    for number, name in enumerate(MAPS):
        wanted = met(device, square_by_hand(number), spread)[name]
        assert wanted[seen].std() > 0.01
        np.testing.assert_allclose(found[name], wanted, atol=1e-4, err_msg=name)


@pytest.mark.thorough
@pytest.mark.parametrize("place", [None, *PLACES[:2]])
def test_the_normal_map_of_a_clearcoat(device: ComputeDevice, place: Place | None) -> None:
    """It lies at its own place, along the tangents of the mesh; without it, nothing is bent."""
    bumps = waves(3)[::-1] - np.float32([0.4, 0.6, 0.0])
    bumpy = replace(PLACED, clearcoat=1.0, clearcoat_normal_texture=bumps)
    bumpy = replace(bumpy, places=(*PLACES, place))
    square = placed_square()
    found = met(device, replace(square, materials=(bumpy,)), 0.0)
    seen = found["finish"][:, 0] >= 0.0
    number = (None, *PLACES).index(place)
    by_hand = square_by_hand(number - 1) if place else replace(square, materials=(ALIKE,))
    own = replace(ALIKE, normal_texture=bumps)
    by_hand = replace(by_hand, materials=(own,), tangents=square.tangents)
    wanted = met(device, by_hand, 0.0)["normal"]
    assert wanted[seen].std() > 0.01
    np.testing.assert_allclose(found["coat_normal"], wanted, atol=1e-4)
    even = replace(bumpy, clearcoat_normal_texture=None)
    coat = met(device, replace(square, materials=(even,)), 0.0)["coat_normal"]
    np.testing.assert_allclose(coat[seen], np.tile(coat[seen][0], (seen.sum(), 1)), atol=1e-6)
    for name in MAPS:
        plain = met(device, square, 0.0)[name]
        np.testing.assert_allclose(found[name], plain, atol=1e-6, err_msg=name)


@pytest.mark.thorough
def test_the_twin_of_an_emission_map(device: ComputeDevice) -> None:
    """The picture, four times along either side."""
    found = met(device, placed_square(), 0.0)
    seen = found["finish"][:, 0] >= 0.0
    uv = PLACES[2].coordinates(found["uv"][seen].astype(np.float64), None)
    assert PLACED.emission_texture is not None
    image = PLACED.emission_texture.astype(np.float16).astype(np.float32)
    wanted = expected(uv, PLACED.samplers[3], image) * PLACED.emission
    np.testing.assert_allclose(found["emission"][seen], wanted, atol=1e-4)


def test_only_maps_that_lie_elsewhere_need_places() -> None:
    assert MaterialNeeds.of([PLACED]).texture_places
    assert not MaterialNeeds.of([ALIKE]).texture_places


def test_a_place_relative_to_another() -> None:
    base, other = PLACES[0].matrix, PLACES[2].matrix
    uvs = np.random.default_rng(2).random((20, 2))
    found = relative(base, other)
    assert found is not None
    there = found.coordinates(Place(base).coordinates(uvs, None), None)
    np.testing.assert_allclose(there, Place(other).coordinates(uvs, None), atol=1e-12)
    assert PLACES[2].scale == 4.0
    assert relative(((1.0, 2.0, 0.0), (2.0, 4.0, 1.0)), other) is None
