"""Tangents of meshes with a normal map.

They follow MikkTSpace (M. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", thesis, 2008,
chapter 3), which glTF asks for where a file has none (Khronos glTF 2.0, section 3.7.2.1). The
tangent of a corner is the mean over the faces around it that have the same position, normal,
texture coordinates and orientation, weighted by their angles there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.creases import Float, Ints


def with_tangents(
    positions: Float, normals: Float, uvs: NDArray[np.floating], triangles: Ints
) -> tuple[Ints, Float, Ints]:
    """Return vertices that all have a tangent.

    A vertex is split where faces with mirrored texture coordinates meet.

    Parameters
    ----------
    positions, normals : (V, 3) float64
        Finite; normals are unit vectors.
    uvs : (V, 2)
        v up.
    triangles : (F, 3) int64

    Returns
    -------
    source : (W,) int64
        Original vertex of each vertex.
    tangents : (W, 4) float64
        Unit vectors along u, perpendicular to the normals, 0 where texture coordinates have no
        area; then the sign of the bitangent along v, relative to normal x tangent.
    triangles : (F, 3) int64
        Indices of the new vertices.
    """
    along_u, mirrored = _faces(positions, uvs, triangles)
    corners = triangles.ravel()
    normal = normals[corners]
    weighted = _unit(_flat(np.repeat(along_u, 3, axis=0), normal))
    weighted *= _angles(positions, normals, triangles)[:, None]
    side = np.repeat(mirrored, 3)
    same = np.concatenate([positions[corners], normal, uvs[corners], side[:, None]], axis=1)
    _, group = np.unique(same, axis=0, return_inverse=True)
    group = group.ravel()
    sums = np.stack([np.bincount(group, axis) for axis in weighted.T], axis=1)
    total = np.asarray(sums[group], np.float64)
    _, first, index = np.unique(2 * corners + side, return_index=True, return_inverse=True)
    sign = np.where(side[first], -1.0, 1.0)
    tangents = np.concatenate([_unit(total[first]), sign[:, None]], axis=1)
    return corners[first], tangents, index.reshape(-1, 3)


def moved_tangents(tangents: NDArray[np.floating], matrices: Float) -> Float:
    """Transform tangents (V, 4) by the linear parts of affine maps, (V, 3, 4) or (1, 3, 4)."""
    linear = matrices[:, :, :3]
    each = np.broadcast_to(linear, (len(tangents), 3, 3))
    turned = _unit(np.einsum("vij,vj->vi", each, tangents[:, :3]))
    sign = np.where(np.linalg.det(linear) < 0.0, -1.0, 1.0) * tangents[:, 3]
    return np.concatenate([turned, sign[:, None]], axis=1)


def _faces(
    positions: Float, uvs: NDArray[np.floating], triangles: Ints
) -> tuple[Float, NDArray[np.bool_]]:
    """Return the direction of growing u of each face, (F, 3), and if its coordinates mirror."""
    corner, at = positions[triangles], uvs[triangles].astype(np.float64)
    edge1, edge2 = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    st1, st2 = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]
    area = st1[:, 0] * st2[:, 1] - st1[:, 1] * st2[:, 0]
    along_u = st2[:, 1:] * edge1 - st1[:, 1:] * edge2
    return np.sign(area)[:, None] * along_u, area < 0.0


def _angles(positions: Float, normals: Float, triangles: Ints) -> Float:
    """Return the angle (3 F,) of each corner's face there, seen along the normal."""
    corner = positions[triangles]
    normal = normals[triangles]
    ahead = _unit(_flat(np.roll(corner, -1, axis=1) - corner, normal))
    behind = _unit(_flat(np.roll(corner, 1, axis=1) - corner, normal))
    cosine = np.clip((ahead * behind).sum(axis=-1), -1.0, 1.0)
    return np.asarray(np.arccos(cosine).ravel(), np.float64)


def _flat(vectors: Float, normals: Float) -> Float:
    """Return the parts of vectors (..., 3) perpendicular to unit normals."""
    along = (vectors * normals).sum(axis=-1, keepdims=True)
    return np.asarray(vectors - along * normals, np.float64)


def _unit(vectors: Float) -> Float:
    """Return unit vectors (..., 3), 0 where there is no length."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0))
