"""Screen-space bounds of objects in both projections."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View

Float = NDArray[np.float64]

_EDGES = np.array([(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit])
"""Corner pairs that form the edges of a box. Corner i takes the upper bound of axis k if bit k of i
is set."""

_MARGIN = 1
"""Margin around the bounds in pixels: sub-pixel coverage borrows from the next pixel."""


class Rect(NamedTuple):
    """A rectangle of the pixels x0 <= x < x1, y0 <= y < y1."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def viewport(self) -> tuple[int, int, int, int]:
        """The rectangle as (x, y, width, height)."""
        return self.x0, self.y0, self.x1 - self.x0, self.y1 - self.y0

    @property
    def pixels(self) -> tuple[slice, slice]:
        """Index into an (H, W, ...) array."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)

    def touches(self, other: Rect) -> bool:
        """Return True if both rectangles share a pixel."""
        return (
            self.x0 < other.x1 and other.x0 < self.x1 and self.y0 < other.y1 and other.y0 < self.y1
        )

    def union(self, other: Rect) -> Rect:
        """Return the bounding rectangle of both."""
        return Rect(
            min(self.x0, other.x0),
            min(self.y0, other.y0),
            max(self.x1, other.x1),
            max(self.y1, other.y1),
        )

    def tiles(self, size: int) -> list[Rect]:
        """Split the rectangle into tiles of at most `size` x `size` pixels."""
        return [
            Rect(x, y, min(x + size, self.x1), min(y + size, self.y1))
            for y in range(self.y0, self.y1, size)
            for x in range(self.x0, self.x1, size)
        ]


def box_corners(low: Float, high: Float) -> Float:
    """Return the (8, 3) corners of an axis-aligned box."""
    upper = (np.arange(8)[:, None] >> np.arange(3)) & 1
    return np.where(upper == 1, high, low)


def box_rects(view: View, corners: Float) -> list[Rect]:
    """Return rectangles that hold all pixels of a box: none, one, or two at the seam.

    Parameters
    ----------
    corners : (8, 3) float64
        World space, in the order of `box_corners` (any affine image of a box).
    """
    local = corners @ view.world_from_view
    if view.projection == "equirect":
        return _equirect_rects(view, local)
    return _perspective_rects(view, local)


def merge(rects: list[Rect]) -> list[Rect]:
    """Merge rectangles into disjoint ones that cover at least the same pixels."""
    merged: list[Rect] = []
    for rect in rects:
        current = rect
        while touching := [other for other in merged if other.touches(current)]:
            for other in touching:
                merged.remove(other)
                current = current.union(other)
        merged.append(current)
    return merged


def _perspective_rects(view: View, local: Float) -> list[Rect]:
    depth = -local[:, 2]
    near = 1e-6 * float(np.abs(local).max())
    start, end = local[_EDGES[:, 0]], local[_EDGES[:, 1]]
    crossing = (depth[_EDGES[:, 0]] > near) != (depth[_EDGES[:, 1]] > near)
    start, end = start[crossing], end[crossing]
    along = (-near - start[:, 2]) / (end[:, 2] - start[:, 2])
    points = np.concatenate([local[depth > near], start + along[:, None] * (end - start)])
    if len(points) == 0:
        return []
    image = np.array([0.5 * view.width, 0.5 * view.height]) + view.focal_px * (
        points[:, :2] * [1.0, -1.0] / -points[:, 2:]
    )
    return _clipped(view, image.min(axis=0), image.max(axis=0))


def _equirect_rects(view: View, local: Float) -> list[Rect]:
    """Bound the cone from the origin, about the box's centre, that contains its corners.

    A meridian is tangent to a cone of half angle a at colatitude t at azimuth asin(sin a / sin t).
    """
    whole = [Rect(0, 0, view.width, view.height)]
    lengths = np.linalg.norm(local, axis=1)
    axis = local.mean(axis=0)
    if lengths.min() == 0.0 or not np.linalg.norm(axis) > 0.0:
        return whole
    axis = axis / np.linalg.norm(axis)
    half = float(np.arccos(np.clip((local @ axis / lengths).min(), -1.0, 1.0))) + 1e-6
    if half >= 0.5 * np.pi:
        return whole
    theta = float(np.arctan2(np.hypot(axis[0], axis[2]), axis[1]))
    rows = np.array([theta - half, theta + half]) * (view.height / np.pi)
    if rows[0] <= 0.0 or rows[1] >= view.height:
        return _clipped(view, np.array([0.0, rows[0]]), np.array([view.width, rows[1]]))
    sweep = float(np.arcsin(min(1.0, np.sin(half) / np.sin(theta)))) / (2.0 * np.pi) * view.width
    centre = (float(np.arctan2(axis[0], -axis[2])) / (2.0 * np.pi) + 0.5) * view.width
    if 2.0 * (sweep + _MARGIN + 1) >= view.width:
        return _clipped(view, np.array([0.0, rows[0]]), np.array([view.width, rows[1]]))
    return [
        rect
        for turn in (-view.width, 0, view.width)
        for rect in _clipped(
            view,
            np.array([centre - sweep + turn, rows[0]]),
            np.array([centre + sweep + turn, rows[1]]),
        )
    ]


def _clipped(view: View, low: Float, high: Float) -> list[Rect]:
    """Return the pixels of bounds in image points, with a margin, clipped to the frame."""
    size = np.array([view.width, view.height])
    first = np.clip(np.floor(low) - _MARGIN, 0, size).astype(int)
    last = np.clip(np.ceil(high) + _MARGIN, 0, size).astype(int)
    if (last <= first).any():
        return []
    return [Rect(int(first[0]), int(first[1]), int(last[0]), int(last[1]))]
