"""Depth with fewer texels than its color: stored at low resolution, or enlarged by repetition.

Depth estimators give, for example, 1024 x 512 texels for a picture of 4096 x 2048. Repeated texels
turn every slanted surface into a staircase. `Grid` detects repeated texels, and `enlarged`
interpolates along surfaces instead. Every coarse texel becomes a plane, as `estimate_normals` fits
it. Planes are exact in inverse depth: `1 / r = g . w` in the direction w.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iprt.footage.depth_noise import fit_tolerance
from iprt.footage.normals import estimate_normals, over_poles
from iprt.footage.video.depth_code import UNMEASURED, usable
from iprt.geometry.equirect import texel_azimuths, texel_directions, texel_polar_angles

Picture = NDArray[np.float32]
Index = slice | NDArray[np.intp]

MIN_FACTOR = 1.15
"""Least factor of repetition that is corrected; a smaller one does no visible harm."""
MIN_ROWS = 16
"""Least number of rows of coarse texels; fewer could be any pattern."""
MIN_CHANGES = 0.3
"""Least share of the borders between coarse texels at which some depth changes. It is small because
quantised depth changes at few of them."""
MAX_CHANCE = 1e-6
"""Largest probability that randomly scattered changes would all lie at such borders."""
SAME_SURFACE = 0.03
"""Largest relative difference in depth of two coarse texels on one surface, where planes meet."""
_FARTHEST = np.float32(2.0)
"""Largest factor by which depth changes within a coarse texel; it bounds planes seen edge-on."""
SAME_PLANE = 0.005
"""Largest distance of a texel from a plane that it fits, relative to depth."""
_FEW, _REACH = 5, 2
"""Least number of texels, of a texel and its eight neighbours, that must fit a plane; and reach,
in texels, of the window in which the candidates for a better plane are compared."""
_BAND_ROWS = 8


@dataclass(frozen=True)
class Grid:
    """Grid of coarse texels that a depth picture repeats.

    Attributes
    ----------
    rows, columns : (h,), (w,) int
        First row and first column of each coarse texel.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the coarse picture."""
        return self.columns.size, self.rows.size

    @classmethod
    def of(cls, depth: Picture) -> Grid | None:
        """Detect the grid of a picture (H, W); return None if no texels are repeated.

        Depth never changes within a coarse texel, over the whole picture, and the borders between
        coarse texels are as regular as a single factor makes them. Constant depth and quantised
        depth have no such pattern.
        """
        bits = np.where(usable(depth), depth, np.float32(0.0))
        down, across = _changes(bits), _changes(bits.T)
        height, width = depth.shape
        fewest = max(int(down.sum()) + 1, MIN_ROWS)
        most = min(int(fewest / MIN_CHANGES), int(height / MIN_FACTOR))
        for count in range(fewest, most + 1):
            rows = _starts(down, count)
            if rows is None or count * width % height:
                continue
            columns = _starts(across, count * width // height)
            if columns is not None:
                return cls(rows, columns)
        return None

    def coarse(self, depth: Picture) -> Picture:
        """Return the depth (h, w) of the coarse texels; 0 where they have none."""
        known = np.where(usable(depth), depth, np.float32(0.0))
        # A mask of finer resolution may have cut holes out of them.
        return np.asarray(self._over(np.maximum, known), np.float32)

    def repeated(self, coarse: Picture, height: int, width: int) -> Picture:
        """Repeat coarse texels (h, w) over the grid, to (height, width)."""
        down = np.diff(self.rows, append=height)
        across = np.diff(self.columns, append=width)
        return coarse.repeat(down, axis=0).repeat(across, axis=1)

    def has_finer_holes(self, depth: Picture) -> bool:
        """Return whether holes cut through coarse texels, such as a mask of the size of color."""
        there = usable(depth)
        some, every = self._over(np.logical_or, there), self._over(np.logical_and, there)
        return bool((some & ~every).any())

    def _over(self, function: np.ufunc, plane: NDArray[np.generic]) -> NDArray[Any]:
        """Reduce a picture (H, W) over each coarse texel, to (h, w)."""
        rows = function.reduceat(plane, self.rows, axis=0)
        return np.asarray(function.reduceat(rows, self.columns, axis=1))


def at_full_size(depth: Picture, grid: Grid | None, width: int, height: int) -> Picture:
    """Return depth (height, width), enlarged along surfaces where its resolution is lower.

    Depth that needs no enlarging is returned as it is.

    Parameters
    ----------
    depth : (H, W) float32
        Stored depth; 0, negative, NaN or inf where there is no surface.
    grid : Grid or None
        The coarse texels that the depth repeats.
    width, height : int
        Size of the color picture.
    """
    coarse = depth if grid is None else grid.coarse(depth)
    if coarse.shape == (height, width):
        return depth
    if grid is None or depth.shape != (height, width) or not grid.has_finer_holes(depth):
        full = enlarged(coarse, width, height)
    else:
        full = enlarged(coarse, width, height, holes=False)
        full = np.where(usable(depth), full, np.float32(0.0))
    return _with_unmeasured(full, depth)


def _with_unmeasured(full: Picture, depth: Picture) -> Picture:
    """Return `full` (H, W) with the `UNMEASURED` texels of `depth`."""
    unmeasured = depth == UNMEASURED
    if not unmeasured.any():
        return full
    (height, width), (rows, columns) = full.shape, depth.shape
    row, column = np.arange(height) * rows // height, np.arange(width) * columns // width
    said = unmeasured[row[:, None], column]
    return np.where(said & ~(full > 0.0), np.float32(UNMEASURED), full)


def _changes(known: Picture) -> NDArray[np.bool_]:
    """Return (H,) whether some depth differs from the row above. Holes do not count."""
    above, below = known[:-1], known[1:]
    changed = np.zeros(known.shape[0], np.bool_)
    changed[1:] = ((above != below) & (above > 0.0) & (below > 0.0)).any(axis=1)
    return changed


def _starts(changed: NDArray[np.bool_], count: int) -> NDArray[np.intp] | None:
    """Return the first texels (count,) of runs of one factor; None if changes do not fit them."""
    size = changed.size
    for centre in (0.5, 0.0):  # the two usual conventions of nearest-neighbour resampling
        texel = np.floor((np.arange(size) + centre) * count / size).astype(np.intp)
        borders = np.diff(texel, prepend=-1) > 0
        if (changed & ~borders).any():
            continue
        found = int(changed.sum())
        if found >= MIN_CHANGES * count and (count / size) ** found < MAX_CHANCE:
            return np.nonzero(borders)[0]
    return None


def enlarged(coarse: Picture, width: int, height: int, *, holes: bool = True) -> Picture:
    """Interpolate depth along surfaces to a higher resolution.

    Each texel blends the four coarse texels around it, weighted bilinearly. Coarse texels that
    agree form a surface, and so do those without a surface. The group with the largest weight
    alone determines the result.

    Parameters
    ----------
    coarse : (h, w) float32
        Depth; 0, negative, NaN or inf where there is no surface.
    holes : bool
        Whether coarse texels without a surface take part. If not, surfaces extend over them as far
        as a neighbouring coarse texel has a depth.

    Returns
    -------
    (height, width) float32
        0 where there is no surface.
    """
    sides = _sides(coarse, width)
    above, below, share = _neighbors(height, coarse.shape[0])
    theta = texel_polar_angles(height)
    sin, cos = (f(theta).astype(np.float32)[:, None] for f in (np.sin, np.cos))
    result = np.empty((height, width), np.float32)
    for first in range(0, height, _BAND_ROWS):
        band = slice(first, min(first + _BAND_ROWS, height))
        inverse = np.empty((4, band.stop - first, width), np.float32)
        weight = np.empty_like(inverse)
        part = share[band, None]
        corners = (
            (row[band] + 1, down, *side)
            for row, down in ((above, 1.0 - part), (below, part))
            for side in sides
        )
        for corner, (row, down, own, outward, up, across) in enumerate(corners):
            plane = sin[band] * outward[row] + cos[band] * up[row]
            known = own[row]
            inverse[corner] = np.clip(plane, known / _FARTHEST, known * _FARTHEST)
            weight[corner] = down * across * (known > 0.0 if not holes else 1.0)
        result[band] = _inverse(_agreed(inverse, weight))
    return result


Side = tuple[Picture, Picture, Picture, Picture]
"""Coarse texels on one side of each of `width` columns, continued by one row over both poles:
inverse depth, 0 where there is no surface; components of `g` along the horizontal direction of each
column, and along +Y; all (h + 2, width). The last one is the bilinear weight (width,)."""


def _sides(coarse: Picture, width: int) -> list[Side]:
    """Return the coarse texels to the left and to the right of the columns."""
    phi = texel_azimuths(width)
    sin, cos = np.sin(phi).astype(np.float32), np.cos(phi).astype(np.float32)
    inverse = over_poles(_inverse(coarse), 1)
    x, y, z = np.moveaxis(over_poles(_planes(coarse), 1), -1, 0)
    left, right, share = _neighbors(width, coarse.shape[1])
    sides = []
    for column, weight in ((left, 1.0 - share), (right, share)):
        at = column % coarse.shape[1]
        sides.append((inverse[:, at], x[:, at] * sin - z[:, at] * cos, y[:, at], weight))
    return sides


def _inverse(plane: Picture) -> Picture:
    """Return 1 / plane where it is a positive number, else 0."""
    there = usable(plane)
    return np.divide(np.float32(1.0), plane, out=np.zeros_like(plane), where=there)


def _neighbors(size: int, coarse_size: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Picture]:
    """Return (size,) coarse texels before (from -1) and after each texel; weight of the latter."""
    at = (np.arange(size) + 0.5) * coarse_size / size - 0.5
    before = np.floor(at).astype(np.intp)
    return before, before + 1, (at - before).astype(np.float32)


def _planes(coarse: Picture) -> Picture:
    """Return `g` (h, w, 3), 1/m, of the plane through each texel's depth; 0 if it has none."""
    h, w = coarse.shape
    there = usable(coarse)
    depth = np.where(there, coarse, np.float32(np.inf))
    normal = estimate_normals(depth, np.zeros(coarse.shape, np.uint8), fit_tolerance(depth))
    direction = np.stack(np.broadcast_arrays(*texel_directions(w, h)), axis=-1).astype(np.float32)
    facing = np.einsum("...i,...i", normal, direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        planes = normal / (depth * facing)[..., None]
    planes = np.where((there & (facing < 0.0))[..., None], planes, np.float32(0.0))
    return _with_borrowed(planes, _Points(direction, _inverse(coarse)))


def _around(plane: Picture) -> Picture:
    """Pad by `_REACH` texels over the poles and across the seam."""
    over = over_poles(plane, _REACH)
    return np.concatenate([over[:, -_REACH:], over, over[:, :_REACH]], axis=1)


class _Points:
    """Points of all coarse texels, padded by `_around`, to compare planes with.

    Parameters
    ----------
    direction : (h, w, 3) float32
    inverse : (h, w) float32
        Inverse depth; 0 where there is no surface.
    """

    def __init__(self, direction: Picture, inverse: Picture) -> None:
        self._direction, self._inverse = _around(direction), _around(inverse)

    def depths(self, planes: Picture, row: Index, column: Index) -> tuple[Picture, Picture]:
        """Return the inverse depth of planes (..., 3) and of texels, in the texels' directions."""
        on_plane = np.einsum("...i,...i", planes, self._direction[row, column])
        return np.asarray(on_plane), self._inverse[row, column]

    def fit(self, planes: Picture, row: Index, column: Index) -> NDArray[np.bool_]:
        """Return whether texels lie on planes."""
        on_plane, own = self.depths(planes, row, column)
        return np.asarray((np.abs(on_plane - own) <= np.float32(SAME_PLANE) * own) & (own > 0.0))

    def ill_fitted(self, planes: Picture) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return rows and columns of texels whose plane in (h, w, 3) fits few neighbours."""
        (height, width), count = planes.shape[:2], np.zeros(planes.shape[:2], np.int8)
        for down, aside in _steps(1):
            top, left = _REACH + down, _REACH + aside
            count += self.fit(planes, slice(top, top + height), slice(left, left + width))
        there = self._inverse[_REACH:-_REACH, _REACH:-_REACH] > 0.0
        row, column = np.nonzero((count < _FEW) & there)
        return row + _REACH, column + _REACH

    def score(
        self, planes: Picture, row: NDArray[np.intp], column: NDArray[np.intp]
    ) -> NDArray[np.int8]:
        """Return (N,) the number of texels around N texels that lie on their planes (N, 3)."""
        count = np.zeros(row.size, np.int8)
        for down, aside in _steps(_REACH):
            count += self.fit(planes, row + down, column + aside)
        return count


def _steps(reach: int) -> list[tuple[int, int]]:
    """Return the offsets (down, aside) of all texels of a square window."""
    steps = range(-reach, reach + 1)
    return [(down, aside) for down in steps for aside in steps]


def _with_borrowed(planes: Picture, points: _Points) -> Picture:
    """Replace badly fitting planes (h, w, 3) by a neighbour's where that fits better.

    A strip one texel wide, such as the far edge of a table, is too small to fit its own plane to.
    """
    padded = _around(planes)
    row, column = points.ill_fitted(planes)
    best = padded[row, column]
    most = points.score(best, row, column)
    for down, aside in _steps(1):
        other = padded[row + down, column + aside]
        on_plane, own = points.depths(other, row, column)
        on_it = points.fit(other, row, column)
        through = (other * (own / np.where(on_it, on_plane, 1.0))[:, None]).astype(np.float32)
        count = np.where(on_it, points.score(through, row, column), 0)
        better = count > most
        most = np.where(better, count, most)
        best = np.where(better[:, None], through, best)
    borrowed = planes.copy()
    borrowed[row - _REACH, column - _REACH] = best
    return borrowed


def _agreed(inverse: Picture, weight: Picture) -> Picture:
    """Return the inverse depth (...) of the largest group of corners (4, ...) that agree.

    It is 0 where this group has no surface.
    """
    mixed = np.einsum("i...,i...", inverse, weight)
    low, high = inverse.min(axis=0), inverse.max(axis=0)
    differ = high - low > np.float32(SAME_SURFACE) * low
    mixed[differ] = _majority(inverse[:, differ], weight[:, differ])
    return np.asarray(mixed, np.float32)


def _majority(inverse: Picture, weight: Picture) -> Picture:
    """Return (N,) the result of `_agreed` for corners (4, N) that do not all agree."""
    limit = np.float32(SAME_SURFACE) * np.minimum(inverse[:, None], inverse[None])
    agree = np.abs(inverse[:, None] - inverse[None]) <= limit
    share = np.where(agree, weight[None], np.float32(0.0))
    total = share.sum(axis=1)
    best = total.argmax(axis=0), np.arange(inverse.shape[1])
    mean = np.einsum("ijn,jn->in", share, inverse)
    return np.asarray(mean[best] / np.maximum(total[best], np.float32(1e-12)), np.float32)
