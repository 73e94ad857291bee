"""Meshes made of arrays, and transforms that place them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from iprt.geometry.material import Material
from iprt.geometry.mesh import Mesh

Float = NDArray[np.float64]


def mesh_of(
    positions: ArrayLike,
    triangles: ArrayLike,
    materials: tuple[Material, ...] = (Material(),),
    normals: ArrayLike = (0.0, 0.0, 0.0),
    uvs: ArrayLike = (0.0, 0.0),
) -> Mesh:
    """Build a mesh; triangle i has material i modulo their number, normals default to none."""
    corners = np.asarray(positions, np.float32).reshape(-1, 3)
    faces = np.asarray(triangles, np.int32).reshape(-1, 3)
    return Mesh(
        corners,
        np.broadcast_to(normals, (len(corners), 3)).astype(np.float32),
        np.broadcast_to(uvs, (len(corners), 2)).astype(np.float32),
        faces,
        (np.arange(len(faces)) % len(materials)).astype(np.int32),
        materials,
    )


def sphere(subdivisions: int = 3, materials: tuple[Material, ...] = (Material(),)) -> Mesh:
    """Build a unit icosphere with smooth normals."""
    shape = trimesh.creation.icosphere(subdivisions=subdivisions)
    return mesh_of(shape.vertices, shape.faces, materials, shape.vertices)


def transform(linear: ArrayLike = 1.0, position: Sequence[float] = (0.0, 0.0, 0.0)) -> Float:
    """Return (4, 4) from a matrix (3, 3), or scales, and a position."""
    matrix, given = np.eye(4), np.asarray(linear, np.float64)
    matrix[:3, :3] = given if given.ndim == 2 else np.diag(np.broadcast_to(given, 3))
    matrix[:3, 3] = position
    return matrix
