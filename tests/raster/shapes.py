"""Meshes and checks that the rasterizer's tests share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, Mesh
from iprt.raster.rasterizer import Rasterizer
from tests import meshes
from tests.meshes import mesh_of, transform

Float = NDArray[np.float64]


@contextmanager
def rasterizer(instances: Sequence[Instance]) -> Iterator[Rasterizer]:
    opened = Rasterizer(instances)
    try:
        yield opened
    finally:
        opened.close()


BLUE = (Material(albedo=(0.2, 0.4, 0.6)),)
UP = (0.0, 0.0, 1.0)


def mesh(
    positions: ArrayLike, triangles: ArrayLike, materials: tuple[Material, ...] = BLUE
) -> Mesh:
    """Build a mesh whose normals are +Z."""
    return mesh_of(positions, triangles, materials, UP)


def sphere(subdivisions: int = 2) -> Mesh:
    return meshes.sphere(subdivisions, BLUE)


def quad(materials: tuple[Material, ...] = BLUE) -> Mesh:
    """Build the square [-1, 1]^2 in the plane z = 0; uv (0, 0) at its lower left corner."""
    positions = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64)
    uvs = 0.5 * (positions[:, :2] + 1.0)
    made = mesh_of(positions, [[0, 1, 2], [0, 2, 3]], materials, UP, uvs)
    return replace(made, material_index=np.zeros(2, np.int32))


def placed(
    shape: Mesh,
    position: Sequence[float] = (0.0, 0.0, 0.0),
    scale: float | Sequence[float] = 1.0,
    rotation: Float | None = None,
    name: str = "object",
) -> Instance:
    linear = (np.eye(3) if rotation is None else rotation) * np.broadcast_to(scale, 3)
    return Instance(name, shape, transform(linear, position))


def direction(yaw_deg: float, pitch_deg: float) -> Float:
    yaw, pitch = np.deg2rad([yaw_deg, pitch_deg])
    return np.array([np.cos(pitch) * np.sin(yaw), np.sin(pitch), -np.cos(pitch) * np.cos(yaw)])
