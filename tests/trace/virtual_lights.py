"""Lights without geometry as objects, and the irradiance of the simplest one."""

from __future__ import annotations

import numpy as np

from iprt.geometry.light import Light
from iprt.geometry.mesh import Instance, light_mesh
from tests.meshes import transform
from tests.worlds import Float

DOWN = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
"""Rotation after which -Z points down, and +Y back."""
PLACE = (0.2, -0.5, -0.9)


def lit_by(
    light: Light, place: tuple[float, ...] = PLACE, linear: Float = DOWN, name: str = "light"
) -> Instance:
    return Instance(name, light_mesh(light), transform(linear, place))


def from_point(points: Float, normals: Float, place: tuple[float, ...] = PLACE) -> Float:
    """(...) irradiance of a point light of intensity 1: cos β / d²."""
    away = np.asarray(place) - points
    distance = np.linalg.norm(away, axis=-1)
    return np.asarray(np.maximum((away * normals).sum(-1), 0.0) / distance**3)
