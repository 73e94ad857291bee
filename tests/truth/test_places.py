"""Maps that lie elsewhere than the color: Mitsuba reads them as if they were laid by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance, Mesh
from iprt.geometry.place import Place
from tests.placed_maps import ALIKE, PLACES
from tests.raster.shapes import placed, quad

pytestmark = pytest.mark.mitsuba

TURNED = Place(((0.0, -1.5, 0.1), (1.5, 0.0, 0.6)))
"""Keeps angles, as Mitsuba's tangents ask for."""
VIEW = View(40, 40, fov_y_deg=30.0)
MAPS = ("surface_texture", "normal_texture", "emission_texture", "clearcoat_normal_texture")


def picture(mi: Any, shape: Mesh) -> np.ndarray:
    """The square beside a lamp, one path through each pixel."""
    from iprt.truth.sensor import sensor
    from iprt.truth.shapes import instance_shapes

    instance: Instance = placed(shape, (0.2, -0.1, -3.0))
    lamp = {"type": "point", "position": [1.0, 1.0, 0.0], "intensity": 10.0}
    scene = mi.load_dict({"type": "scene", "lamp": lamp, **instance_shapes([instance])})
    camera = sensor(VIEW, pixel_centres=True)
    path = mi.load_dict({"type": "path", "max_depth": 2})
    return np.array(mi.render(scene, sensor=camera, integrator=path, spp=1, seed=1))[..., :3]


@pytest.mark.parametrize("number", range(4), ids=MAPS)
def test_a_map_is_shown_at_its_place(mi: Any, number: int) -> None:
    """With this map and no other."""
    place = TURNED if number in (1, 3) else PLACES[2 * (number > 0)]
    lacquered = {"clearcoat": 1.0, "clearcoat_alpha": 0.1, MAPS[3]: ALIKE.normal_texture}
    others = {name: None for name in ("texture", *MAPS) if name != MAPS[number]}
    emission = (3.0, 2.0, 1.0) if number == 2 else (0.0, 0.0, 0.0)
    alike = replace(replace(ALIKE, **lacquered), emission=emission, **others)
    places = tuple(place if index == number else None for index in range(4))
    shape = quad((alike,))
    uvs = place.coordinates(shape.uvs, None).astype(np.float32)
    found = picture(mi, replace(shape, materials=(replace(alike, places=places),)))
    wanted = picture(mi, replace(shape, uvs=uvs))
    assert wanted[wanted.sum(axis=-1) > 0.0].std() > 0.02
    np.testing.assert_allclose(found, wanted, atol=2e-3)
    assert np.abs(picture(mi, shape) - wanted).max() > 0.1


def test_a_second_set_is_a_loss(mi: Any, caplog: pytest.LogCaptureFixture) -> None:
    from iprt.truth.shapes import instance_shapes

    shape = quad((replace(ALIKE, places=(None, None, Place(second=True), None)),))
    instance_shapes([placed(replace(shape, uvs2=shape.uvs), name="lamp")])
    assert "lamp: the truth shows maps of its second" in caplog.text
