"""Geometry of gizmos and outlines, which both viewers draw over the picture."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from iprt.geometry.camera import View
from iprt.viewer.object_states import ObjectState

Float = NDArray[np.float64]

NEAR_M, FAR_M = 0.01, 1000.0
_EDGES = [(a, b) for a, b in combinations(range(8), 2) if (a ^ b).bit_count() == 1]


def camera_matrix(view: View, centre: Float) -> Float:
    """Return the (4, 4) transform from the world to view space, at a capture centre (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3] = view.world_from_view.T
    matrix[:3, 3] = -matrix[:3, :3] @ centre
    return matrix


def projection_matrix(view: View) -> Float:
    """Return the (4, 4) OpenGL projection of a perspective view."""
    up = 1.0 / np.tan(0.5 * np.deg2rad(view.fov_y_deg))
    depth = NEAR_M - FAR_M
    return np.array(
        [
            [up * view.height / view.width, 0.0, 0.0, 0.0],
            [0.0, up, 0.0, 0.0],
            [0.0, 0.0, (FAR_M + NEAR_M) / depth, 2.0 * FAR_M * NEAR_M / depth],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )


def box_edges(state: ObjectState, view: View, centre: Float) -> Float:
    """Return the edges of an object's bounding box that are in front of the camera.

    Returns
    -------
    (N, 2, 2) float64
        Both ends of each edge in pixels of the view.
    """
    points = state.box - centre
    seen = points @ view.world_from_view[:, 2] < -1e-3
    ends = [(points[a], points[b]) for a, b in _EDGES if seen[a] and seen[b]]
    return view.project(np.reshape(ends, (-1, 2, 3)))


def path_segments(points: Float, view: View, centre: Float) -> Float:
    """Return the parts of a line through points (N, 3) of the world that are before the camera.

    Returns
    -------
    (M, 2, 2) float64
        Both ends of each part in pixels of the view.
    """
    seen = points - centre
    ends = np.stack([seen[:-1], seen[1:]], axis=1)
    depth = -(ends @ view.world_from_view[:, 2])
    ends, depth = ends[(depth > NEAR_M).any(axis=1)], depth[(depth > NEAR_M).any(axis=1)]
    for end, other in ((0, 1), (1, 0)):
        behind = depth[:, end] < NEAR_M
        share = (NEAR_M - depth[behind, end]) / (depth[behind, other] - depth[behind, end])
        ends[behind, end] += share[:, None] * (ends[behind, other] - ends[behind, end])
    return view.project(ends)


def turn_of(state: ObjectState) -> Float:
    """Return an object's rotation (3, 3)."""
    return polar(state.to_world[:3, :3])[0]


def turned_to(state: ObjectState, turn: Float, pivot: Float | None = None) -> Float:
    """Return the transform (4, 4) of this rotation and the same size, with a pivot (3,)."""
    return state.about_pivot(turn @ polar(state.to_world[:3, :3])[1], pivot)


def polar(linear: Float) -> tuple[Float, Float]:
    """Return a rotation and a stretch, (3, 3) both, whose product is an invertible `linear`."""
    turn, stretch = linalg.polar(linear)
    sign = np.sign(np.linalg.det(turn))
    return sign * turn, sign * stretch
