"""Brute-force twin of the rasterizer: every pixel-centre ray against every triangle, float64."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.geometry.mesh import Instance

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Soup:
    """World-space triangles of all instances.

    Attributes
    ----------
    corners, normals : (F, 3, 3) float64
        By triangle, corner, component.
    uvs : (F, 3, 2) float64
    material, instance : (F,) int64
        Material index over all instances; instance index.
    flipped : (F,) bool
        The transform turned counter-clockwise into clockwise.
    """

    corners: Float
    normals: Float
    uvs: Float
    material: Int
    instance: Int
    flipped: NDArray[np.bool_]


@dataclass(frozen=True)
class Hits:
    """Nearest hit per ray: triangle (-1: none), distance, barycentric coordinates, |cos|."""

    triangle: Int
    distance: Float
    weights: Float
    cosine: Float


def gather(instances: Sequence[Instance]) -> Soup:
    columns: list[list[NDArray[np.generic]]] = [[] for _ in range(6)]
    first_material = 0
    for index, instance in enumerate(instances):
        mesh, matrix = instance.mesh, instance.to_world
        linear = matrix[:3, :3]
        normals = mesh.normals @ np.linalg.inv(linear)
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        count = len(mesh.triangles)
        parts = (
            (mesh.positions @ linear.T + matrix[:3, 3])[mesh.triangles],
            normals[mesh.triangles],
            mesh.uvs.astype(np.float64)[mesh.triangles],
            mesh.material_index.astype(np.int64) + first_material,
            np.full(count, index),
            np.full(count, np.linalg.det(linear) < 0.0),
        )
        for column, part in zip(columns, parts, strict=True):
            column.append(part)
        first_material += len(mesh.materials)
    return Soup(*(np.concatenate(column) for column in columns))


def cast(
    soup: Soup, directions: Float, origins: Float | float = 0.0, *, away_only: bool = False
) -> Hits:
    """Return the nearest hits of rays (Möller and Trumbore 1997); (..., 3) unit directions."""
    rays = directions.reshape(-1, 3)
    v0 = soup.corners[:, 0]
    e1, e2 = soup.corners[:, 1] - v0, soup.corners[:, 2] - v0
    normal = np.cross(e1, e2)
    best = Hits(
        np.full(len(rays), -1),
        np.full(len(rays), np.inf),
        np.zeros((len(rays), 3)),
        np.zeros(len(rays)),
    )
    for index in range(len(v0)):
        p = np.cross(rays, e2[index])
        det = p @ e1[index]
        with np.errstate(divide="ignore", invalid="ignore"):
            start = origins - v0[index]
            u = np.einsum("...i,...i", start, p) / det
            q = np.cross(start, e1[index])
            v = np.einsum("...i,...i", rays, q) / det
            t = q @ e2[index] / det
        hit = (
            (det != 0.0)
            & (u >= 0.0)
            & (v >= 0.0)
            & (u + v <= 1.0)
            & (t > 0.0)
            & (t < best.distance)
        )
        along = rays @ normal[index]
        if away_only:
            hit &= (along < 0.0) if soup.flipped[index] else (along > 0.0)
        best.triangle[hit] = index
        best.distance[hit] = t[hit]
        best.weights[hit] = np.stack([1.0 - u - v, u, v], axis=-1)[hit]
        best.cosine[hit] = np.abs(along[hit]) / np.linalg.norm(normal[index])
    shape = directions.shape[:-1]
    return Hits(
        best.triangle.reshape(shape),
        best.distance.reshape(shape),
        best.weights.reshape(*shape, 3),
        best.cosine.reshape(shape),
    )


def cast_view(
    soup: Soup, view: View, *, away_only: bool = False, nudge: float = 0.01
) -> tuple[Hits, NDArray[np.bool_]]:
    """Hits of the pixel centres, and which of them see the same triangle `nudge` pixels around."""
    x, y = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
    centres = np.stack([x, y], axis=-1)
    hits = cast(soup, view.unproject(centres), away_only=away_only)
    steady = np.ones(hits.triangle.shape, bool)
    for offset in ((-nudge, -nudge), (nudge, -nudge), (-nudge, nudge), (nudge, nudge)):
        around = cast(soup, view.unproject(centres + np.array(offset)), away_only=away_only)
        steady &= around.triangle == hits.triangle
    return hits, steady
