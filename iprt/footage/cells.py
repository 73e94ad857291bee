"""Surfaces of a panorama, averaged over equirect cells."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import Frame
from iprt.geometry.camera import View
from iprt.geometry.equirect import solid_angles

Float = NDArray[np.float64]

SKY = 50.0
"""Distance of open sky, relative to the farthest surface."""
GRAZING = 0.1
"""Least cosine of view used to compute the area of a cell's surface from its normal."""
NORMAL_ROWS = 1024
"""Least number of rows to which normals are fitted in a larger panorama: ten per cell suffice."""


def cell_sums(picture: NDArray[np.generic], rows: int) -> Float:
    """Sum a picture (H, 2 H, ...) over cells (rows, 2 rows, ...); H >= `rows`."""
    down, across = _cell_ends(picture.shape, rows)
    # Sum over rows first: `reduceat` takes ten times as long across rows.
    strips = [picture[a:b].sum(axis=0, dtype=np.float64) for a, b in pairwise(down)]
    return np.asarray(np.add.reduceat(np.stack(strips), across[:-1], axis=1))


def cell_means(picture: NDArray[np.generic], rows: int) -> Float:
    """Average a picture (H, 2 H, ...) over cells (rows, 2 rows, ...); H >= `rows`."""
    sums = cell_sums(picture, rows)
    return _over(sums, cell_texels(picture.shape, rows))


def cell_texels(shape: tuple[int, ...], rows: int) -> NDArray[np.intp]:
    """Return the number of texels (rows, 2 rows) in each cell of a picture of this shape."""
    down, across = _cell_ends(shape, rows)
    return np.outer(np.diff(down), np.diff(across))


def binned(values: NDArray[np.floating], cell: NDArray[np.intp], count: int) -> Float:
    """Sum values (N, C) over the cells (N,) that they belong to: (count, C)."""
    return np.stack([np.bincount(cell, part, count) for part in values.T], axis=-1)


def _cell_ends(shape: tuple[int, ...], rows: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first texels (rows + 1,) and (2 rows + 1,) of cells; coarser cells share them."""
    height, width = shape[:2]
    down = -(-np.arange(rows + 1) * height // rows)
    return down, -(-np.arange(2 * rows + 1) * width // (2 * rows))


def _over(sums: Float, texels: NDArray[np.number]) -> Float:
    return np.asarray(sums / texels.reshape(*texels.shape, *[1] * (sums.ndim - 2)))


def sampled_normals(frame: Frame) -> NDArray[np.float32]:
    """Return `Frame.fitted_normal`, for large panoramas at every n-th texel only: (h, w, 3).

    Fitting to all texels takes long on the host.
    """
    step = frame.height // NORMAL_ROWS
    if step < 2:
        return frame.fitted_normal
    chosen = (slice(step // 2, None, step),) * 2
    normal = None if frame.normal is None else frame.normal[chosen]
    depth, opening = frame.depth[chosen], frame.opening[chosen]
    return replace(frame, depth=depth, opening=opening, normal=normal).fitted_normal


@dataclass(frozen=True)
class Geometry:
    """Sums of a frame's geometry over cells, from which coarser cells can be made.

    Attributes
    ----------
    texels : (R, 2 R) int
        Number of texels.
    inverse, squared : (R, 2 R) float64
        Sums of inverse depth in 1/m, and of its square.
    normal : (R, 2 R, 3) float64
        Mean normals times `texels`.
    opening, sky : (R, 2 R) float64
        Numbers of texels in openings and in open sky.
    """

    texels: NDArray[np.intp]
    inverse: Float
    squared: Float
    normal: Float
    opening: Float
    sky: Float

    @classmethod
    def of(cls, frame: Frame, rows: int) -> Geometry:
        """Sum over cells of the finest kind in use; `rows` is at most the frame's."""
        finite = np.isfinite(frame.depth)
        far = float(frame.depth[finite].max()) if finite.any() else 1.0
        inverse = np.float32(1.0) / np.where(finite, frame.depth, np.float32(SKY * far))
        texels = cell_texels(frame.depth.shape, rows)
        return cls(
            texels=texels,
            inverse=cell_sums(inverse, rows),
            squared=cell_sums(np.square(inverse, out=inverse), rows),
            normal=cell_means(sampled_normals(frame), rows) * texels[..., None],
            opening=cell_sums(frame.opening, rows),
            sky=cell_sums(~finite, rows),
        )

    def mean(self, sums: Float, rows: int) -> Float:
        """Return the means (rows, 2 rows, ...) for one of these sums."""
        return _over(cell_sums(sums, rows), cell_sums(self.texels, rows))


@dataclass(frozen=True)
class Cells:
    """Surfaces of a panorama in cells, row by row.

    Attributes
    ----------
    rows : int
        Number of rows, half the number of columns; N = 2 rows².
    direction, point, normal : (N, 3) float64
        Direction from the capture centre; point in metres; unit normal.
    depth : (N,) float64
        Metres.
    area : (N,) float64
        Area of the surface in the cell, in m².
    solid_angle : (N,) float64
        Solid angle about the capture centre, in sr.
    opening, sky : (N,) float64
        Shares of the cell, in [0, 1].
    rough : (N,) float64
        Relative standard deviation of inverse depth, plus 1 minus the length of the mean normal.
    """

    rows: int
    direction: Float
    point: Float
    normal: Float
    depth: Float
    area: Float
    solid_angle: Float
    opening: Float
    sky: Float
    rough: Float

    @classmethod
    def of(cls, shown: Geometry, rows: int) -> Cells:
        """Build cells from sums over cells of the same size, or finer ones."""
        mean = shown.mean(shown.inverse, rows).ravel()
        squared = shown.mean(shown.squared, rows).ravel()
        spread = np.sqrt(np.maximum(squared - mean**2, 0.0)) / mean
        direction = View(2 * rows, rows, projection="equirect").directions().reshape(-1, 3)
        normal = shown.mean(shown.normal, rows).reshape(-1, 3)
        length = np.linalg.norm(normal, axis=-1)
        normal = np.where(
            length[:, None] > 0.3, normal / np.maximum(length, 1e-9)[:, None], -direction
        )
        solid_angle = np.repeat(solid_angles(2 * rows, rows), 2 * rows)
        depth = 1.0 / mean
        facing = np.abs((normal * direction).sum(-1))
        return cls(
            rows=rows,
            direction=direction,
            point=direction * depth[:, None],
            normal=normal,
            depth=depth,
            area=solid_angle * depth**2 / np.maximum(facing, GRAZING),
            solid_angle=solid_angle,
            opening=shown.mean(shown.opening, rows).ravel(),
            sky=shown.mean(shown.sky, rows).ravel(),
            rough=spread + 1.0 - np.minimum(length, 1.0),
        )
