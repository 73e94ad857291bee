"""Normals for meshes whose files have none: flat, or smooth up to a crease angle.

glTF requires flat normals (Khronos glTF 2.0, section 3.7.2.1). For the other formats, an edge is
smooth if its faces meet at less than `CREASE_DEG`, and sharp otherwise. Spheres then look round,
and boxes do not.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

Float = NDArray[np.float64]
Ints = NDArray[np.int64]

CREASE_DEG = 40.0
"""Angle between two face normals from which their common edge is sharp. A cylinder of ten sides is
still round; a chamfer of 45 degrees keeps its edges."""
_SIDES = 3
"""Number of other faces at an edge that a face is compared with. A closed surface has one, a
doubled surface three."""


def with_normals(
    positions: Float, normals: Float, triangles: Ints, flat: NDArray[np.bool_]
) -> tuple[Ints, Float, Ints]:
    """Return vertices that all have a normal, adding normals where there are none.

    A vertex without a normal is split into as many as it needs. Smooth normals are means of the
    faces around a position up to the next sharp edges, weighted by the faces' angles there (Thürmer
    and Wüthrich, "Computing Vertex Normals from Polygonal Facets", 1998).

    Parameters
    ----------
    positions : (V, 3) float64
        Finite. Vertices at the same position belong together.
    normals : (V, 3) float64
        Vectors of any length. NaN or zero length means no normal.
    triangles : (F, 3) int64
        Not degenerate.
    flat : (F,) bool
        Faces with sharp edges only.

    Returns
    -------
    source : (W,) int64
        Original vertex of each vertex; 0 to V - 1 in order if all have normals.
    normals : (W, 3) float64
        Unit vectors.
    triangles : (F, 3) int64
        Indices of the new vertices.
    """
    usable = have_normals(normals)
    with np.errstate(invalid="ignore", divide="ignore"):
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = np.where(usable[:, None], normals / length, [0.0, 1.0, 0.0])
    corners = triangles.ravel()
    if usable[corners].all():
        return np.arange(len(positions)), unit, triangles
    group, of_group = _groups(positions, triangles, flat)
    group[usable[corners]] = 0
    key, first, index = np.unique(
        group * len(positions) + corners, return_index=True, return_inverse=True
    )
    source = corners[first]
    divided = np.where(usable[source, None], unit[source], of_group[key // len(positions)])
    return source, divided, index.reshape(-1, 3)


def have_normals(normals: Float) -> NDArray[np.bool_]:
    """Return (V,) flags: the normals (V, 3) are finite and have a length."""
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.linalg.norm(normals, axis=1)
        usable: NDArray[np.bool_] = np.isfinite(length) & (length > 1e-12)
    return usable


def face_normals(corners: Float) -> Float:
    """Return the (F, 3) unit normals of counter-clockwise triangles (F, 3, 3); 0 if degenerate."""
    normals: Float = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    np.divide(normals, length, out=normals, where=length > 0.0)
    return normals


def _groups(positions: Float, triangles: Ints, flat: NDArray[np.bool_]) -> tuple[Ints, Float]:
    """Group the corners that share a smooth normal.

    Returns
    -------
    group : (3 F,) int64
        Group of each corner, counted from 1.
    normals : (G, 3) float64
        Unit normals by group; entry 0 is unused.
    """
    corners = positions[triangles]
    face = face_normals(corners)
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    sine = np.linalg.norm(np.cross(ahead, behind), axis=2)
    angle = np.arctan2(sine, np.einsum("fij,fij->fi", ahead, behind))
    group = 1 + _joined_corners(same_position(positions)[triangles], face, flat)
    total = np.stack(
        [np.bincount(group, (angle * face[:, axis, None]).ravel()) for axis in range(3)], axis=1
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    (lost,) = np.nonzero(length[group, 0] < 1e-12)  # surrounding faces cancel out
    total[group[lost]], length[group[lost]] = face[lost // 3], 1.0
    return group, np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)


def same_position(positions: Float) -> Ints:
    """Return (V,) numbers that are equal for vertices at the same position."""
    order = np.lexsort(positions.T)
    changes = (positions[order[1:]] != positions[order[:-1]]).any(axis=1)
    numbers = np.empty(len(positions), np.int64)
    numbers[order] = np.concatenate([[0], np.cumsum(changes)])
    return numbers


def _joined_corners(points: Ints, face: Float, flat: NDArray[np.bool_]) -> Ints:
    """Return (3 F,) numbers that are equal for corners connected through smooth edges.

    Parameters
    ----------
    points : (F, 3) int64
        Numbers of positions.
    face : (F, 3) float64
        Unit normals.
    flat : (F,) bool
        Faces with sharp edges only.
    """
    count = points.size
    start, end = points.ravel(), np.roll(points, -1, axis=1).ravel()
    corner = np.arange(count)
    following = np.roll(corner.reshape(-1, 3), -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    edge = low * (int(points.max(initial=0)) + 1) + high
    at_low = np.where(start < end, corner, following)
    at_high = np.where(start < end, following, corner)
    order = np.argsort(edge, kind="stable")
    pairs = []
    for step in range(1, 1 + _SIDES):
        one, other = order[:-step], order[step:]
        shared = (edge[one] == edge[other]) & ~flat[one // 3] & ~flat[other // 3]
        one, other = one[shared], other[shared]
        cosine = np.einsum("ei,ei->e", face[one // 3], face[other // 3])
        smooth = cosine > np.cos(np.deg2rad(CREASE_DEG))
        one, other = one[smooth], other[smooth]
        pairs += [(at_low[one], at_low[other]), (at_high[one], at_high[other])]
    rows, columns = (np.concatenate(side) for side in zip(*pairs, strict=True))
    graph = scipy.sparse.coo_array(
        (np.ones(len(rows), np.bool_), (rows, columns)), shape=(count, count)
    )
    return np.asarray(
        scipy.sparse.csgraph.connected_components(graph, directed=False)[1].astype(np.int64)
    )
