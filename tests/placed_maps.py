"""A square whose maps lie at four places, and squares on which one of them is laid by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh, tangent_mesh
from iprt.geometry.place import Place
from tests.raster.shapes import quad

PLACES = (
    Place(((1.2, -0.5, 0.3), (0.4, 2.1, -0.2))),
    Place(((0.0, 1.5, 0.1), (-2.0, 0.0, 0.6)), second=True),
    Place(((4.0, 0.0, 0.25), (0.0, 4.0, 0.5))),
)
"""Of the surface, the normals and the emission: sheared, on the second set, and four times."""
_SECOND = np.array([[0.2, 0.1], [0.4, 0.9], [-0.3, 1.2], [-0.5, 0.3]], np.float32)
"""Coordinates of the second set at the square's corners."""


def waves(channels: int) -> NDArray[np.float32]:
    """A smooth picture, 16 texels wide and 8 high, that repeats."""
    y, x = np.mgrid[0:8, 0:16] * np.pi * np.array([2 / 8, 2 / 16])[:, None, None]
    planes = [np.sin(x), np.cos(y), np.sin(x + y)][:channels]
    return (0.5 + 0.4 * np.stack(planes, axis=-1)).astype(np.float32)


ALIKE = Material(
    "principled",
    (0.9, 0.8, 0.7),
    alpha=0.5,
    metallic=0.8,
    emission=(3.0, 2.0, 1.0),
    texture=waves(3),
    surface_texture=waves(2),
    normal_texture=waves(3) - np.float32([0.5, 0.5, 0.0]),
    emission_texture=waves(3),
)
"""All of its maps lie alike."""
PLACED = replace(ALIKE, places=(*PLACES, None))


def placed_square() -> Mesh:
    """Return the square with `PLACED`."""
    shape = replace(quad((PLACED,)), uvs2=_SECOND)
    return replace(shape, tangents=square_by_hand(1).tangents)


def square_by_hand(number: int) -> Mesh:
    """Return the square with all maps where map `number` of `PLACES` lies."""
    shape = quad((ALIKE,))
    uvs = PLACES[number].coordinates(shape.uvs, _SECOND)
    return tangent_mesh(replace(shape, uvs=uvs.astype(np.float32)))
