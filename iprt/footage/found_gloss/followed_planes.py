"""Views of a moving camera on the planes of its first frame, as evidence of gloss.

Texture and shading stay fixed on a plane, while reflections move over it. Frames from the place of
the first one are left out. There, moving objects change shadows and light too finely for the cells,
which looks like a rough reflection. Planes are tracked by camera poses. All data about a plane is
indexed by the cells of the first frame, so that a cell is the same piece of surface in all frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.albedo_segments import lifted
from iprt.footage.cell_planes import NEAREST, CellPlane
from iprt.footage.cells import Cells, Float, Geometry, cell_means
from iprt.footage.form_factors import irradiance_of_lights, irradiance_of_rest
from iprt.footage.found_gloss.coat_reflection import RAYS, Patch, RoomCells, reflected
from iprt.footage.found_gloss.evidence import Later, PlanePicture
from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel, equirect_texel
from iprt.geometry.pose import camera_motion

LIGHT_ROWS, REST_ROWS = 64, 16
"""Rows of cells: for lights and the receivers of their light; and for all other light."""
LIGHT_STEPS, REST_STEPS = 12, 6
"""Numbers of points at which visibility is tested along a line of sight."""
BRIGHT = 3.0
"""Least radiance of a light's cells, relative to the mean."""
SAMPLES = 4
"""Number of samples per side of a cell, as seen by a moved camera."""
MIN_SEEN = 0.25
"""Least share of a plane's cells that another frame must show."""


Shown = tuple[Float, NDArray[np.bool_], float]
"""View of a plane in another frame, by the n cells of the first frame: mean radiance (n, 3); where
(n,) it is seen; median brightness relative to the first frame, mostly due to exposure."""


@dataclass(frozen=True)
class Moment:
    """A frame in cells of its own panorama.

    Attributes
    ----------
    around : RoomCells
        The surroundings.
    bright : (R, 2 R, 3) float64
        Mean radiance in cells of `LIGHT_ROWS` rows, or of fewer if the frame has fewer.
    motion : (3, 4) float64 or None
        Transform of points from the first frame's axes to this frame's; None: identity.
    """

    around: RoomCells
    bright: Float
    motion: Float | None = None

    @classmethod
    def of(cls, frame: Frame, rows: int, first: Frame) -> Moment:
        """Build the cells of a frame, with `rows` rows; at most the frame's."""
        motion = camera_motion(frame.pose, first.pose)
        return cls(
            around=RoomCells.of(frame, Geometry.of(frame, rows), rows),
            bright=cell_means(frame.radiance, min(LIGHT_ROWS, rows)),
            motion=None if np.array_equal(motion, np.eye(4)[:3]) else motion,
        )

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
        """Return irradiance over π (2, n, 3) of a plane's cells: from lights, and from the rest."""
        rows = self.bright.shape[0]
        middle = Cells.of(self.around.shown, rows)
        coarse = Cells.of(self.around.shown, min(REST_ROWS, rows))
        color = self.bright
        mean = np.average(color.mean(axis=-1).ravel(), weights=middle.solid_angle)
        light = middle.opening.reshape(rows, -1) > 0.5
        light |= color.mean(axis=-1) > BRIGHT * mean
        share = cell_means(~light, coarse.rows).ravel()
        dim = cell_means(color * ~light[..., None], coarse.rows).reshape(-1, 3)
        lights = (color * light[..., None]).reshape(-1, 3, 1)
        at, nearest = _sparse(plane.cells, cells.rows, cells.rows // rows)
        receivers = self._moved(lifted(cells, at)), self._turned(cells.normal[at])
        direct, taken = irradiance_of_lights(
            *receivers, middle, self.around.cells, lights, LIGHT_STEPS
        )
        rest = irradiance_of_rest(*receivers, coarse, dim, share, taken, REST_STEPS)
        return np.stack([direct[..., 0], rest])[:, nearest] / np.pi

    def shown(self, frame: Frame, first: RoomCells, plane: CellPlane, tolerance: float) -> Shown:
        """Return this frame's view of a plane of the first one; `frame` holds its texels."""
        color, seen = self._looked_up(frame, first.cells, plane, tolerance)
        before = first.color[plane.cells].mean(axis=-1)
        ratio = (color.mean(axis=-1) / np.maximum(before, 1e-12))[seen]
        return color, seen, max(float(np.median(ratio)), 1e-6) if seen.any() else 1.0

    def _looked_up(
        self, frame: Frame, cells: Cells, plane: CellPlane, tolerance: float
    ) -> tuple[Float, NDArray[np.bool_]]:
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
                seen &= ~frame.opening[at] & (near < tolerance * np.maximum(depth, NEAREST))
        return color / side**2, seen

    def _moved(self, point: Float) -> Float:
        if self.motion is None:
            return point
        return np.asarray(point @ self.motion[:, :3].T + self.motion[:, 3])

    def _turned(self, vector: Float) -> Float:
        return vector if self.motion is None else np.asarray(vector @ self.motion[:, :3].T)


class Followed:
    """A plane of the first frame, tracked through other frames."""

    def __init__(self, first: Moment, plane: CellPlane) -> None:
        self.plane = plane
        self._first = first
        self._moments = [first]
        self._shown: list[Shown] = []

    def follow(self, moment: Moment, frame: Frame, tolerance: float) -> None:
        """Add another frame, if it shows enough of the plane."""
        shown = moment.shown(frame, self._first.around, self.plane, tolerance)
        if shown[1].mean() >= MIN_SEEN:
            self._moments.append(moment)
            self._shown.append(shown)

    def picture(self, *, shaded: bool = True) -> PlanePicture:
        """Return the plane's picture in all frames, with or without its shading."""
        cells = self._first.around.cells
        shading = [np.zeros((0, len(self.plane.cells), 3))] * len(self._moments)
        if shaded:
            shading = [moment.shading(cells, self.plane) for moment in self._moments]
        later = [
            Later(color / gain, light / gain, seen)
            for (color, seen, gain), light in zip(self._shown, shading[1:], strict=True)
        ]
        color = self._first.around.color
        return PlanePicture(cells, self.plane.cells, color, shading[0], later)

    def reflected(self, alpha: float, seed: int, rays: int = RAYS) -> Float:
        """Return (1 + frames, KINDS, n, 3) reflection; see `coat_reflection.reflected`."""
        cells = self._first.around.cells
        gains = [1.0, *(gain for _, _, gain in self._shown)]
        return np.stack(
            [
                reflected(moment.around, moment.patch(cells, self.plane), alpha, seed, rays) / gain
                for moment, gain in zip(self._moments, gains, strict=True)
            ]
        )


def _sparse(
    on: NDArray[np.intp], rows: int, step: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return one of `on` (n,) per block of step x step cells, and for each cell its index (n,)."""
    row, column = np.divmod(on, 2 * rows)
    _, first, nearest = np.unique(
        row // step * 2 * rows + column // step, return_index=True, return_inverse=True
    )
    return on[first], nearest.astype(np.intp)


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
