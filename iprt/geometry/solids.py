"""Dielectrics as solids: light is refracted into closed surfaces only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.creases import same_position
from iprt.geometry.mesh import Mesh

OPEN = (
    "a surface of glass is open, so light passes straight on, as through a pane; close the mesh, "
    "or set thin = true"
)

SWELLING = 5e-4
"""Share of a solid's longest side by which its surface moves outward. Rays start up to 1e-5 of
their distance beyond a surface, and would miss another one there."""


def with_solids(mesh: Mesh) -> Mesh:
    """Return a mesh whose dielectrics are closed solids, with normals outward, or thin walls.

    An open surface becomes a thin wall, with a warning. A closed one that is inside out is turned.
    """
    warnings = [line for line in mesh.warnings if line != OPEN]
    materials, normals, triangles = list(mesh.materials), mesh.normals, mesh.triangles
    corners: NDArray[np.int64] | None = None
    for index, material in enumerate(mesh.materials):
        own = mesh.material_index == index
        if not material.transmits or material.thin or not own.any():
            continue
        if corners is None:
            corners = same_position(mesh.positions.astype(np.float64))[mesh.triangles]
        if not _is_closed(corners[own]):
            materials[index] = replace(material, thin=True)
            warnings.append(OPEN)
        elif _volume(mesh, own) < 0.0:
            normals, triangles = normals.copy(), triangles.copy()
            normals[np.unique(triangles[own])] *= -1.0
            triangles[own] = triangles[own][:, ::-1]
    return replace(
        mesh,
        materials=tuple(materials),
        normals=normals,
        triangles=triangles,
        warnings=tuple(dict.fromkeys(warnings)),
    )


def solids(mesh: Mesh) -> tuple[int, ...]:
    """Return the indices of the materials that are solids."""
    used = np.unique(mesh.material_index)
    return tuple(
        int(index)
        for index in used
        if mesh.materials[index].transmits and not mesh.materials[index].thin
    )


def swollen(mesh: Mesh) -> Mesh:
    """Return a mesh whose solids are larger by `SWELLING`, so that touching ones overlap.

    Faces that coincide would be met as one: a ray that leaves a solid would not enter the other.
    Each plane around a vertex moves by the same distance.
    """
    positions = mesh.positions.astype(np.float64)
    for index in solids(mesh):
        (own,) = np.nonzero(
            np.bincount(
                mesh.triangles[mesh.material_index == index].ravel(), minlength=len(positions)
            )
        )
        place = same_position(positions[own])
        planes = np.unique(np.column_stack([place, mesh.normals[own].round(3)]), axis=0)
        at, normals = planes[:, 0].astype(np.int64), planes[:, 1:]
        total = np.stack([np.bincount(at, normals[:, i]) for i in range(3)], axis=1)
        mean = total / np.bincount(at)[:, None]
        squared = np.maximum(np.einsum("vi,vi->v", mean, mean), 0.1)
        outward = (mean / squared[:, None])[place]
        positions[own] += SWELLING * float(np.ptp(positions[own], axis=0).max()) * outward
    return replace(mesh, positions=positions.astype(np.float32))


def _is_closed(corners: NDArray[np.int64]) -> bool:
    """Return True if each edge of triangles (F, 3) is passed as often in either direction."""
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    forth = np.unique(np.stack([start, end]), axis=1, return_counts=True)
    back = np.unique(np.stack([end, start]), axis=1, return_counts=True)
    return all(np.array_equal(one, other) for one, other in zip(forth, back, strict=True))


def _volume(mesh: Mesh, own: NDArray[np.bool_]) -> float:
    """Return six times the signed volume that some of a mesh's triangles enclose."""
    a, b, c = np.moveaxis(mesh.positions[mesh.triangles[own]].astype(np.float64), 1, 0)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)))
