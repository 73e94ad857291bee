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
