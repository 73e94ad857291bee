"""Meshes that are hard on trees and on intersection tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import NDArray

from iprt.geometry.mesh import Instance, Mesh
from tests.meshes import mesh_of

Float = NDArray[np.float64]


def instance_of(mesh: Mesh, matrix: Float | None = None, name: str = "object") -> Instance:
    return Instance(name, mesh, np.eye(4) if matrix is None else matrix)


def turned(axis: Sequence[float], degrees: float) -> Float:
    """(3, 3) rotation."""
    return np.asarray(trimesh.transformations.rotation_matrix(np.deg2rad(degrees), axis)[:3, :3])


def bumpy(rng: np.random.Generator, subdivisions: int = 4) -> Mesh:
    """A closed mesh, not convex, whose vertices are in no order."""
    shape = trimesh.creation.icosphere(subdivisions=subdivisions)
    radius = 1.0 + 0.3 * np.sin(5.0 * shape.vertices).prod(axis=1)
    order = rng.permutation(len(shape.vertices))
    place = np.argsort(order)
    vertices = (shape.vertices * radius[:, None])[order]
    return mesh_of(vertices, place[rng.permutation(shape.faces)], normals=shape.vertices[order])


def same_centres(count: int) -> Mesh:
    """Triangles of all sizes about one point."""
    angle = np.array([0.0, 2.0, 4.0]) * np.pi / 3.0
    corners = np.stack([np.cos(angle), np.sin(angle), np.zeros(3)], axis=1)
    positions = (corners * np.linspace(0.1, 1.0, count)[:, None, None]).reshape(-1, 3)
    return mesh_of(positions, np.arange(3 * count).reshape(-1, 3))


def fan(count: int) -> Mesh:
    """Long thin triangles around a common corner."""
    angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
    rim = np.stack([1e3 * np.cos(angle), 1e3 * np.sin(angle), np.zeros(count + 1)], axis=1)
    first = np.arange(1, count + 1)
    triangles = np.stack([np.zeros(count, int), first, first + 1], axis=1)
    return mesh_of(np.concatenate([np.zeros((1, 3)), rim]), triangles)


def growing(count: int) -> Mesh:
    """Triangles in a row, each so much larger than those before that it is best split off alone."""
    size = 2.0 ** np.arange(count)[:, None, None]
    corners = np.array([[1.0, 0.0, 0.0], [1.5, 0.0, 0.0], [1.0, 0.5, 0.0]])
    return mesh_of((corners * size).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
