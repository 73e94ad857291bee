"""Denoising of estimated depth by projection onto locally fitted planes.

With noisy depth, tangent planes fitted to 5 x 5 texels vary from texel to texel, and so does the
shading of surfaces. Where `Noise` finds any, planes are fitted to many more texels
(`fit_cells`), and each texel moves to the planes around it that it agrees with (`smoothed`).
Exact depth stays unchanged, bit for bit.

A plane is a vector g with g . x = 1 for its points x, and 1 - g . x is the distance of a point from
the plane relative to its depth. The sums of x and of x x^T over texels therefore suffice both to
fit a plane and to measure the texels' squared distance from another one. Sums of several cells add
up without a change of basis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cell_planes import find_planes
from iprt.footage.cells import Cells
from iprt.footage.depth_noise import GAP_TOLERANCE
from iprt.footage.normals import window_taps
from iprt.footage.video.depth_code import usable
from iprt.geometry.equirect import solid_angles, texel_directions, texel_polar_angles

Picture = NDArray[np.float32]
Float = NDArray[np.float64]
Mask = NDArray[np.bool_]

CLEAN = 1e-4
"""Relative noise up to which depth counts as exact, below the rounding to millimetres at 2 m."""
MIN_ROWS = 128
"""Least number of rows: smaller panoramas do not resolve noise from shape."""
CELL_ROWS = 128
"""Largest number of rows of the grid of cells to which planes are fitted: 1.4 degrees each."""
REACH = 6.0
"""Cut-off of the distance from a plane, in standard deviations of the noise. Tukey's biweight uses
4.7 for normal errors; those from estimators have longer tails."""
ROUGHEST = 3.0
"""Largest ratio of local noise to the panorama's: estimators are worse in some places."""
PASSES = 3
SHARED_REACH = 12.0
"""Cut-off of the distance from a large plane, in standard deviations of shared errors."""
_WINDOWS, _ACROSS = 40, 5
_BLOCK_ROWS = 64
_OWN_WEIGHT = 1e-3
_NEIGHBORS = [(down, aside) for down in (-1, 0, 1) for aside in (-1, 0, 1)]


class Noise:
    """Noise of a video's depth, measured again where samples have changed."""

    def __init__(self) -> None:
        self._depth: Picture | None = None
        self._off = np.zeros((0, 2))

    def of(self, depth: Picture, known: Mask) -> tuple[float, float]:
        """Estimate relative RMS deviations from local surfaces: first tercile over the panorama.

        They are estimated in windows of 5 x 5 samples, which keep away from the poles.

        Returns
        -------
        bent : float
            Deviation from quadratic surfaces, which also fit curved walls; 0 if fewer than 30
            windows have depth.
        flat : float
            Deviation from planes, larger where errors are shared by many texels.
        """
        windows = _windows(*depth.shape)
        samples = np.where(known[windows.at], depth[windows.at], np.float32(0.0))
        if self._depth is None or self._depth.shape != samples.shape:
            self._off = np.zeros((len(samples), 2))
            stale = np.ones(len(samples), bool)
        else:
            stale = (samples != self._depth).any(axis=1)
        self._depth = samples
        whole = (samples > 0.0).all(axis=1)
        if stale.any():
            shapes = windows.shapes[stale] * samples[stale, :, None]
            self._off[stale] = _departures(shapes)
        if np.count_nonzero(whole) < 30:
            return 0.0, 0.0
        bent, flat = np.quantile(self._off[whole], 1.0 / 3.0, axis=0)
        return float(bent), float(flat)


@dataclass(frozen=True)
class _Windows:
    """Windows of samples: indices (windows, samples) of texels, and shapes over depth.

    Their sum over terms, times depth, is 1 on the surface: 1 / z over inverse depth.
    """

    at: tuple[NDArray[np.intp], NDArray[np.intp]]
    shapes: Float


@lru_cache(maxsize=2)
def _windows(height: int, width: int) -> _Windows:
    step = max(1, round(height / 256))
    rows = np.linspace(0.15 * height, 0.85 * height, _WINDOWS).astype(np.intp)
    row = np.repeat(rows, 2 * _WINDOWS)[:, None]
    column = np.tile(np.arange(2 * _WINDOWS) * width // (2 * _WINDOWS), _WINDOWS)[:, None]
    polar = texel_polar_angles(height)
    theta = polar[row]
    offset = (np.arange(_ACROSS) - _ACROSS // 2) * step
    down, aside = np.repeat(offset, _ACROSS), np.tile(offset, _ACROSS)
    aside = aside * np.rint(1.0 / np.sin(theta)).astype(np.intp)
    at = row + down, (column + aside) % width
    to, phi = polar[at[0]], aside * 2.0 * np.pi / width
    ahead = np.cos(theta) * np.cos(to) + np.sin(theta) * np.sin(to) * np.cos(phi)
    a = np.sin(to) * np.sin(phi) / ahead
    b = (np.sin(theta) * np.cos(to) - np.cos(theta) * np.sin(to) * np.cos(phi)) / ahead
    shapes = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=-1)
    return _Windows(at, shapes * ahead[..., None])


def _departures(shapes: Float) -> Float:
    """Return (windows, 2) RMS residuals of least-squares fits of 1, by all shapes and by three.

    Each window fits 1 by a linear combination of its shapes (windows, n, terms).
    """
    size = np.linalg.norm(shapes, axis=1, keepdims=True)
    basis, _ = np.linalg.qr(shapes / np.where(size > 0.0, size, 1.0))
    # The first columns of an orthonormal basis and the first shapes span one space.
    rest, off = np.ones(basis.shape[:2]), []
    for terms in (basis[..., :3], basis[..., 3:]):
        rest = rest - np.einsum("nij,nj->ni", terms, terms.sum(axis=1))
        off.append(np.sqrt((rest * rest).mean(axis=1)))
    return np.stack(off[::-1], axis=-1)


def smoothed(depth: Picture, noise: Noise | None = None) -> Picture:
    """Move noisy depth to the planes around it; return the same array if it has no noise.

    Steps and creases that stand out from the noise stay, and so do details smaller than a cell.

    Parameters
    ----------
    depth : (H, W) float32
        Metres; 0, negative, NaN or inf where there is no surface. Such values stay.
    noise : Noise or None
        Noise of the video; None: of this picture alone.

    Returns
    -------
    (H, W) float32
    """
    height, width = depth.shape
    if height < MIN_ROWS or width != 2 * height:
        return depth
    known = usable(depth)
    bent, flat = (noise or Noise()).of(depth, known)
    if bent <= CLEAN:
        return depth
    exact = np.where(known, depth, np.float32(0.0))
    planes = fit_cells(exact, known, flat)
    # Draw a second time with weights at the new place, so that a texel's own noise hardly matters.
    drawn = _drawn(exact, _drawn(exact, exact, planes), planes)
    # Local smoothing does not remove the noise that many texels share.
    shared = float(np.sqrt(max(flat**2 - bent**2, 0.0)))
    drawn = _flattened(drawn, planes, SHARED_REACH * shared)
    return np.where(known, drawn, depth)


def fit_cells(depth: Picture, known: Mask, noise: float) -> Float:
    """Fit planes to cells.

    A cell starts from the plane of the best-fitting window of 3 x 3 cells that contains it, as in
    Kuwahara's filter, which avoids edges. It then gathers the texels near this plane in 5 x 5
    cells.

    Parameters
    ----------
    depth : (H, W) float32
        Metres; 0 where not `known`.
    noise : float
        `flat` of `Noise.of`.

    Returns
    -------
    (rows, columns, 4) float64
        Picture g of each cell, 0 where none fits, and the largest relative distance of its texels.
    """
    sums = _cell_sums(depth, known)
    rows, columns = sums.shape[1:]
    taps = [
        (tap.row[:, None], (np.arange(columns) + tap.columns[:, None]) % columns)
        for tap in window_taps(columns, rows)
    ]
    near = [taps[5 * (down + 2) + aside + 2] for down, aside in _NEIGHBORS]
    least = 0.25 * depth.size / (rows * columns)
    plane = np.zeros((rows, columns, 3))
    off = np.full((rows, columns), np.inf)
    window = np.sum([sums[:, *at] for at in near], axis=0)
    own = _fitted(window)
    own_off = np.where(window[0] >= 4.0 * least, _squared_distance(window, own), np.inf)
    for at in near:
        nearer = own_off[at] < off
        off = np.where(nearer, own_off[at], off)
        plane = np.where(nearer[..., None], own[at], plane)
    reach = REACH * np.clip(np.sqrt(off), noise, ROUGHEST * noise)
    reach = np.minimum(reach, GAP_TOLERANCE[1])
    for _ in range(PASSES):
        joined = np.zeros_like(sums)
        for at in taps:
            cells = sums[:, *at]
            joined += cells * _agreement(_squared_distance(cells, plane) / reach**2)
        plane = np.where((joined[0] >= least)[..., None], _fitted(joined), 0.0)
    return np.concatenate([plane, reach[..., None]], axis=-1)


def _cell_sums(depth: Picture, known: Mask) -> Float:
    """Return (10, rows, columns) sums of 1, x, y, z, xx, xy, xz, yy, yz and zz over cells."""
    height, width = depth.shape
    rows = min(CELL_ROWS, height // 2)
    down, across = (
        np.searchsorted(_splines(texels, cells)[0], np.arange(cells))
        for texels, cells in ((height, rows), (width, 2 * rows))
    )
    narrow = np.empty((10, height, 2 * rows))
    for first in range(0, height, _BLOCK_ROWS):
        block = slice(first, min(first + _BLOCK_ROWS, height))
        x, y, z = (part * depth[block] for part in texel_directions(width, height, block))
        for number, values in enumerate(
            (known[block], x, y, z, x * x, x * y, x * z, y * y, y * z, z * z)
        ):
            narrow[number, block] = np.add.reduceat(values.astype(np.float64), across, axis=1)
    return np.asarray(np.add.reduceat(narrow, down, axis=1))


def _fitted(sums: Float) -> Float:
    """Return g (..., 3) with the least sum of (1 - g . x)^2, from sums (10, ...)."""
    _, x, y, z, xx, xy, xz, yy, yz, zz = sums
    matrix = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1)
    matrix = matrix.reshape(*x.shape, 3, 3)
    # Points on a line leave the rotation about it free. The ridge chooses the shortest g.
    ridge = 1e-9 * (xx + yy + zz) + 1e-30
    matrix += ridge[..., None, None] * np.eye(3)
    return np.asarray(np.linalg.solve(matrix, np.stack([x, y, z], axis=-1)[..., None])[..., 0])


def _squared_distance(sums: Float, plane: Float) -> Float:
    """Return the mean of (1 - g . x)^2 for sums (10, ...) and planes g (..., 3)."""
    n, x, y, z, xx, xy, xz, yy, yz, zz = sums
    a, b, c = np.moveaxis(plane, -1, 0)
    total = n - 2.0 * (a * x + b * y + c * z) + a * a * xx + b * b * yy + c * c * zz
    total += 2.0 * (a * b * xy + a * c * xz + b * c * yz)
    return np.asarray(np.maximum(total, 0.0) / np.maximum(n, 1.0))


def _agreement(squared: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return Tukey's biweight of squared distances, given relative to the cut-off."""
    return np.asarray(np.maximum(1.0 - squared, 0.0) ** 2, squared.dtype)


def _drawn(depth: Picture, place: Picture, planes: Float) -> Picture:
    """Move `depth` (H, W) to the planes of the 3 x 3 cells around that pass near `place`.

    Quadratic B-splines weight the cells, so that one plane blends smoothly into the next.
    """
    height, width = depth.shape
    rows, columns = planes.shape[:2]
    drawn = np.empty_like(depth)
    planes = planes.astype(np.float32)
    cell, weight_across = _splines(width, columns)
    cell_row, weight_down = _splines(height, rows)
    for first in range(0, height, _BLOCK_ROWS):
        block = slice(first, min(first + _BLOCK_ROWS, height))
        x, y, z = (part.astype(np.float32) for part in texel_directions(width, height, block))
        at = place[block]
        total, shift = np.zeros_like(at), np.zeros_like(at)
        for down, aside in _NEIGHBORS:
            row = np.clip(cell_row[block] + down, 0, rows - 1)
            there = planes[row][:, (cell + aside) % columns]
            inverse = there[..., 0] * x + there[..., 1] * y + there[..., 2] * z
            off = (inverse * at - 1.0) / there[..., 3]
            weight = np.maximum(1.0 - off * off, 0.0) ** 2
            weight *= weight_down[down + 1, block, None] * weight_across[aside + 1]
            total += weight
            shift += weight * (inverse * depth[block] - 1.0)
        drawn[block] = depth[block] / (1.0 + shift / (total + np.float32(_OWN_WEIGHT)))
    return drawn


def _flattened(depth: Picture, planes: Float, reach: float) -> Picture:
    """Move `depth` (H, W) to the large planes (`find_planes`) that its cells belong to.

    This removes errors shared by large parts of floors or walls, up to `reach` times the depth.
    """
    height, width = depth.shape
    rows, columns = planes.shape[:2]
    cells = _as_cells(planes[..., :3])
    large = find_planes(cells, reach, cells.sky == 0.0)
    members = np.zeros((len(large), rows * columns), np.float32)
    for member, plane in zip(members, large, strict=True):
        member[plane.cells] = 1.0
    member_of = members.reshape(-1, rows, columns)
    cell, across = _splines(width, columns)
    cell_row, down = _splines(height, rows)
    wide = sum(member_of[:, :, (cell + step) % columns] * across[step + 1] for step in (-1, 0, 1))
    flattened = np.empty_like(depth)
    for first in range(0, height, _BLOCK_ROWS):
        block = slice(first, min(first + _BLOCK_ROWS, height))
        direction = np.stack(np.broadcast_arrays(*texel_directions(width, height, block)), axis=-1)
        shift = np.zeros_like(depth[block])
        for number, plane in enumerate(large):
            off = (direction @ (plane.normal / plane.offset)).astype(np.float32) * depth[block]
            off -= 1.0
            weight = sum(
                wide[number, np.clip(cell_row[block] + step, 0, rows - 1)]
                * down[step + 1, block, None]
                for step in (-1, 0, 1)
            )
            shift += weight * _agreement((off / reach) ** 2) * off
        flattened[block] = depth[block] / (1.0 + shift)
    return flattened


def _as_cells(planes: Float) -> Cells:
    """Return cells of tangent planes (rows, columns, 3); sky where there is none."""
    rows, columns = planes.shape[:2]
    direction = np.stack(np.broadcast_arrays(*texel_directions(columns, rows)), axis=-1)
    direction = direction.reshape(-1, 3)
    g = planes.reshape(-1, 3)
    inverse = (g * direction).sum(axis=-1)
    there = inverse > 0.0
    depth = 1.0 / np.where(there, inverse, 1.0)
    length = np.linalg.norm(g, axis=-1)
    solid_angle = np.repeat(solid_angles(columns, rows), columns)
    none = np.zeros(len(g))
    return Cells(
        rows=rows,
        direction=direction,
        point=direction * depth[:, None],
        normal=np.where(there[:, None], -g / np.where(there, length, 1.0)[:, None], -direction),
        depth=depth,
        area=solid_angle * depth * depth,
        solid_angle=solid_angle,
        opening=none,
        sky=np.where(there, 0.0, 1.0),
        rough=none,
    )


def _splines(texels: int, cells: int) -> tuple[NDArray[np.intp], Picture]:
    """Return the cell (texels,) of each texel, and B-spline weights (3, texels).

    The weights belong to the previous cell, the cell itself and the next one.
    """
    place = (np.arange(texels) + 0.5) * cells / texels
    cell = np.floor(place).astype(np.intp)
    past = place - cell
    weights = np.stack([0.5 * (1.0 - past) ** 2, 0.75 - (past - 0.5) ** 2, 0.5 * past**2])
    return cell, weights.astype(np.float32)
