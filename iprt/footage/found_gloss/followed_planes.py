"""Views of a moving camera on the planes of its first frame, as evidence of gloss.

Texture and shading stay fixed on a plane, while reflections move over it. Frames from the place of
the first one are left out. There, moving objects change shadows and light too finely for the cells,
which looks like a rough reflection. Planes are tracked by camera poses. All data about a plane is
indexed by the cells of the first frame, so that a cell is the same piece of surface in all frames.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cell_planes import NEAREST, CellPlane
from iprt.footage.cells import Cells, Float, Geometry, cell_means
from iprt.footage.coat_reflection import RAYS, Patch, RoomCells, reflected
from iprt.footage.found_gloss.evidence import Later, PlanePicture
from iprt.footage.frame import Frame
from iprt.footage.received_light import RoomLight
from iprt.footage.window_environment import outside_radiance
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel, equirect_texel
from iprt.geometry.pose import camera_motion

FINEST = 512
"""Largest number of rows of cells."""
WINDOW_ROWS, REST_ROWS = 64, 32
"""Least rows of cells in which light from windows and all other light are computed."""
MIN_POINTS = 100
"""Least number of points at which a plane's light is computed."""
WINDOW_RAYS = 1
"""Rays from such a point to each part of a window."""
SAMPLES = 4
"""Number of samples per side of a cell, as seen by a moved camera."""
MIN_SEEN = 0.25
"""Least share of a plane's cells that another frame must show."""


Shown = tuple[Float, NDArray[np.bool_], float]
"""View of a plane in another frame, by the n cells of the first frame: mean radiance (n, 3); where
(n,) it is seen; median brightness relative to the first frame, mostly due to exposure."""


class Moment:
    """A frame in cells of its own panorama.

    Parameters
    ----------
    frame, first : Frame
        This frame, and the one whose axes planes are given in.
    """

    def __init__(self, frame: Frame, first: Frame) -> None:
        self.motion: Float | None = None
        """(3, 4) transform of points from the first frame's axes to this frame's; None: identity.
        """
        motion = camera_motion(frame.pose, first.pose)
        if not np.array_equal(motion, np.eye(4)[:3]):
            self.motion = motion
        self._frame = frame
        self._rooms: dict[int, RoomCells] = {}

    def around(self, rows: int) -> RoomCells:
        """Return the surroundings in cells of `rows` rows; at most `FINEST`, and the frame's."""
        if rows not in self._rooms:
            self._rooms[rows] = RoomCells.of(self._frame, self._geometry, rows)
        return self._rooms[rows]

    @cached_property
    def _geometry(self) -> Geometry:
        return Geometry.of(self._frame, min(FINEST, self._frame.height))

    @cached_property
    def _light(self) -> RoomLight:
        return RoomLight.of(self._frame, self._geometry)

    @cached_property
    def _outside(self) -> Float:
        opening = self._frame.opening
        outside = outside_radiance(self._frame.radiance[opening], opening)
        return outside.reshape(-1, 3).astype(np.float64)

    def patch(self, cells: Cells, plane: CellPlane) -> Patch:
        """Return a plane of the first frame in this frame's axes; `cells` are the first frame's."""
        patch = Patch.of(cells, plane)
        if self.motion is None:
            return patch
        point = self._moved(cells.point[plane.cells])
        return Patch(
            start=self._moved(patch.start),
            direction=point / np.linalg.norm(point, axis=-1, keepdims=True),
            normal=self._turned(plane.normal),
        )

    def shading(self, cells: Cells, plane: CellPlane) -> Float:
        """Return irradiance over π (2, n, 3) of a plane's cells: by windows, and by the rest."""
        at, nearest = _sparse(plane.cells, cells.rows, REST_ROWS)
        rest = self._light.from_surfaces(*self._receivers(cells, at))[nearest]
        if not self._frame.opening.any():
            return rest[None] / np.pi
        at, nearest = _sparse(plane.cells, cells.rows, WINDOW_ROWS)
        windows = self._light.through_windows(*self._receivers(cells, at), WINDOW_RAYS)
        return np.stack([rest, (windows @ self._outside)[nearest]]) / np.pi

    def _receivers(self, cells: Cells, at: NDArray[np.intp]) -> tuple[Float, Float]:
        return self._moved(cells.point[at]), self._turned(cells.normal[at])

    def shown(self, first: RoomCells, plane: CellPlane) -> Shown:
        """Return this frame's view of a plane of the first one."""
        color, seen = self._looked_up(first.cells, plane)
        before = first.color[plane.cells].mean(axis=-1)
        ratio = (color.mean(axis=-1) / np.maximum(before, 1e-12))[seen]
        return color, seen, max(float(np.median(ratio)), 1e-6) if seen.any() else 1.0

    def _looked_up(self, cells: Cells, plane: CellPlane) -> tuple[Float, NDArray[np.bool_]]:
        frame = self._frame
        rows = cells.rows * min(SAMPLES, frame.height // cells.rows)
        picture = cell_means(frame.radiance, rows)
        row, column = np.divmod(plane.cells, 2 * cells.rows)
        normal, fine = self._turned(plane.normal), View(2 * rows, rows, projection="equirect")
        direction = fine.directions()
        offset = plane.offset if self.motion is None else plane.offset + normal @ self.motion[:, 3]
        color, seen = np.zeros((len(row), 3)), np.ones(len(row), bool)
        side = rows // cells.rows
        for down in range(side):
            for across in range(side):
                way = direction[row * side + down, column * side + across]
                facing = np.minimum(way @ plane.normal, -1e-3)
                point = self._moved(way * (plane.offset / facing)[:, None])
                color += _bilinear(picture, point)
                at = equirect_texel(point, frame.width, frame.height)
                depth = np.where(np.isfinite(frame.depth[at]), frame.depth[at], 0.0)
                there = point / np.linalg.norm(point, axis=-1, keepdims=True) * depth[:, None]
                near = np.abs(there @ normal - offset)
                seen &= ~frame.opening[at] & (near < plane.tolerance * np.maximum(depth, NEAREST))
        return color / side**2, seen

    def _moved(self, point: Float) -> Float:
        if self.motion is None:
            return point
        return np.asarray(point @ self.motion[:, :3].T + self.motion[:, 3])

    def _turned(self, vector: Float) -> Float:
        return vector if self.motion is None else np.asarray(vector @ self.motion[:, :3].T)


class Followed:
    """A plane of the first frame, tracked through other frames."""

    def __init__(self, first: Moment, plane: CellPlane, rows: int) -> None:
        self.plane = plane
        self.cells = first.around(rows).cells
        self._first = first.around(rows)
        self._moments = [first]
        self._shown: list[Shown] = []

    def follow(self, moment: Moment) -> None:
        """Add another frame, if it shows enough of the plane."""
        shown = moment.shown(self._first, self.plane)
        if shown[1].mean() >= MIN_SEEN:
            self._moments.append(moment)
            self._shown.append(shown)

    def picture(self, *, shaded: bool = True) -> PlanePicture:
        """Return the plane's picture in all frames, with or without its shading."""
        shading = [np.zeros((0, len(self.plane.cells), 3))] * len(self._moments)
        if shaded:
            shading = [moment.shading(self.cells, self.plane) for moment in self._moments]
        later = [
            Later(color / gain, light / gain, seen)
            for (color, seen, gain), light in zip(self._shown, shading[1:], strict=True)
        ]
        return PlanePicture(self.cells, self.plane.cells, self._first.color, shading[0], later)

    def reflected(self, alpha: float, seed: int, rays: int = RAYS) -> Float:
        """Return (1 + frames, KINDS, n, 3) reflection; see `coat_reflection.reflected`."""
        gains = [1.0, *(gain for _, _, gain in self._shown)]
        parts = []
        for moment, gain in zip(self._moments, gains, strict=True):
            around, patch = moment.around(self.cells.rows), moment.patch(self.cells, self.plane)
            parts.append(reflected(around, patch, alpha, seed, rays) / gain)
        return np.stack(parts)


def _sparse(
    on: NDArray[np.intp], rows: int, sparse_rows: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return one of `on` (n,) per cell of a coarser grid, and for each cell its index (n,).

    The grid has at least `sparse_rows` rows, and more until it has `MIN_POINTS` cells.
    """
    row, column = np.divmod(on, 2 * rows)
    step = max(1, rows // sparse_rows)
    while True:
        coarse = row // step * 2 * rows + column // step
        _, first, nearest = np.unique(coarse, return_index=True, return_inverse=True)
        if step == 1 or len(first) >= MIN_POINTS:
            return on[first], nearest.astype(np.intp)
        step //= 2


def _bilinear(picture: Float, point: Float) -> Float:
    """Sample an equirect picture (H, 2 H, 3) bilinearly in the directions of points (n, 3)."""
    height, width = picture.shape[:2]
    column, row = np.moveaxis(equirect_pixel(point, width, height) - 0.5, -1, 0)
    row = np.clip(row, 0.0, height - 1.0)
    x, y = np.floor(column).astype(np.intp), np.floor(row).astype(np.intp)
    u, v = (column - x)[:, None], (row - y)[:, None]
    below = np.minimum(y + 1, height - 1)
    upper = picture[y, x % width] * (1.0 - u) + picture[y, (x + 1) % width] * u
    lower = picture[below, x % width] * (1.0 - u) + picture[below, (x + 1) % width] * u
    return np.asarray(upper * (1.0 - v) + lower * v)
