"""Meshes and checks that the rasterizer's tests share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import trimesh
from numpy.typing import NDArray

from iprt.geometry.material import Material
from iprt.geometry.mesh import Instance, Mesh
from iprt.raster.rasterizer import Rasterizer

Float = NDArray[np.float64]


@contextmanager
def rasterizer(instances: Sequence[Instance]) -> Iterator[Rasterizer]:
    opened = Rasterizer(instances)
    try:
        yield opened
    finally:
        opened.close()


def mesh(
    positions: Float,
    triangles: NDArray[np.integer],
    normals: Float | None = None,
    uvs: Float | None = None,
    materials: tuple[Material, ...] = (Material(albedo=(0.2, 0.4, 0.6)),),
) -> Mesh:
    """Normals default to +Z, triangle i has material i modulo their number."""
    count = len(positions)
    return Mesh(
        np.asarray(positions, np.float32),
        np.asarray(
            np.tile([0.0, 0.0, 1.0], (count, 1)) if normals is None else normals, np.float32
        ),
        np.asarray(np.zeros((count, 2)) if uvs is None else uvs, np.float32),
        np.asarray(triangles, np.int32).reshape(-1, 3),
        (np.arange(len(triangles)) % len(materials)).astype(np.int32),
        materials,
    )


def sphere(subdivisions: int = 2) -> Mesh:
    """Unit icosphere."""
    shape = trimesh.creation.icosphere(subdivisions=subdivisions)
    return mesh(shape.vertices, shape.faces, normals=shape.vertices)


def quad(materials: tuple[Material, ...] = (Material(albedo=(0.2, 0.4, 0.6)),)) -> Mesh:
    """Square [-1, 1]^2 in the plane z = 0 that faces +Z; uv (0, 0) at its lower left corner."""
    positions = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64)
    made = mesh(
        positions,
        np.array([[0, 1, 2], [0, 2, 3]]),
        uvs=0.5 * (positions[:, :2] + 1.0),
        materials=materials,
    )
    return replace(made, material_index=np.zeros(2, np.int32))


def placed(
    shape: Mesh,
    position: Sequence[float] = (0.0, 0.0, 0.0),
    scale: float | Sequence[float] = 1.0,
    rotation: Float | None = None,
    name: str = "object",
) -> Instance:
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if rotation is None else rotation) * np.broadcast_to(scale, 3)
    matrix[:3, 3] = position
    return Instance(name, shape, matrix)


def direction(yaw_deg: float, pitch_deg: float) -> Float:
    yaw, pitch = np.deg2rad([yaw_deg, pitch_deg])
    return np.array([np.cos(pitch) * np.sin(yaw), np.sin(pitch), -np.cos(pitch) * np.cos(yaw)])
