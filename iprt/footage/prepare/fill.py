"""Cleaning of color and depth: holes are filled or set to infinity, and openings flagged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.prepare.openings import HoleFinder
from iprt.footage.video.depth_code import usable

Mask = NDArray[np.bool_]
Picture = NDArray[np.float32]

_CG_TOLERANCE = 1e-5
_CG_TEXEL_STEPS = 3e7
"""Unknowns times iterations per level. Small levels converge, which leaves only fine detail to the
large ones."""


@dataclass(frozen=True)
class CleanDepth:
    """Depth (H, W) float32 and openings (H, W) bool, as `Frame` holds them."""

    depth: Picture
    opening: Mask


def sanitize_color(color: Picture) -> Picture:
    """Set negative and non-finite radiance (H, W, 3) to 0.

    Returns the same array if there is none.
    """
    with np.errstate(invalid="ignore"):
        # Both are NaN if any value is.
        if color.min() >= 0.0 and color.max() < np.inf:
            return color
        usable = np.isfinite(color) & (color > 0.0)
    return np.where(usable, color, np.float32(0.0)).astype(np.float32)


class Filling:
    """Holes of a video's depth, sorted and filled again where they or their rims change."""

    def __init__(self) -> None:
        self.holes = HoleFinder()
        self._fill: Mask | None = None
        self._rim = np.zeros((0, 0), bool)
        self._texel = np.zeros(0, np.intp)
        self._around = np.zeros(0, np.float32)
        self._filled = np.zeros(0)

    def __call__(self, stored: Picture, known: Mask, fill: Mask) -> NDArray[np.float64]:
        """Return `fill_inverse_depth` of the rim alone, on which nothing else bears."""
        stays = self._fill is not None and np.array_equal(self._fill, fill)
        if not stays:
            self._fill, self._rim = fill, known & _with_neighbors(fill)
            self._texel = np.flatnonzero(self._rim)
        around = stored.ravel()[self._texel]
        if not stays or not np.array_equal(self._around, around):
            inverse = np.zeros(stored.shape, np.float32)
            with np.errstate(over="ignore"):
                inverse.ravel()[self._texel] = np.float32(1.0) / around
            self._around = around
            self._filled = fill_inverse_depth(inverse, self._rim, fill)
        return self._filled


def _with_neighbors(mask: Mask) -> Mask:
    """Return a mask (H, W) of the sphere with its eight neighbours."""
    wide = mask.copy()
    wide[1:] |= mask[:-1]
    wide[:-1] |= mask[1:]
    return wide | np.roll(wide, 1, axis=1) | np.roll(wide, -1, axis=1)


def sanitize_depth(stored: Picture, color: Picture, filling: Filling | None = None) -> CleanDepth:
    """Fill the holes that a rim closes, and set the others to infinity.

    Parameters
    ----------
    stored : (H, W) float32
        Metres from the capture centre; 0, negative, NaN or inf where there is no surface,
        `UNMEASURED` where there is a surface without a measurement.
    color : (H, W, 3) float32
        Linear radiance, finite.
    filling : Filling or None
        Of the frame before; None: a frame alone.
    """
    measured = usable(stored)
    if measured.all():
        return CleanDepth(stored, np.zeros_like(measured))
    filling = filling or Filling()
    holes = filling.holes(stored, measured, color)
    fill = holes.opening | holes.dropout
    filled = filling(stored, measured, fill)
    depth = np.where(measured, stored, np.float32(np.inf))
    with np.errstate(divide="ignore"):
        depth[fill] = np.where(filled > 0.0, 1.0 / filled, np.inf)
    return CleanDepth(depth, holes.opening)


def fill_inverse_depth(
    inverse: NDArray[np.floating], known: Mask, fill: Mask
) -> NDArray[np.float64]:
    """Interpolate inverse depth smoothly over holes.

    Solves `laplace(f) + 2 f = 0` on the sphere with f given on the rim. The inverse depth of a
    plane `n . p = 1` seen along the unit vector w is f = n . w, a spherical harmonic of degree 1,
    whose Laplacian is -2 f. A hole in a plane is therefore filled with that plane, where a plain
    Laplacian bulges towards the viewer. Holes below 2 pi sr have a unique, positive solution, as
    their lowest eigenvalue is above the hemisphere's, which is 2.

    Parameters
    ----------
    inverse : (H, W) float
        1/m where `known`, else 0.
    known, fill : (H, W) bool
        Disjoint. Texels in neither are open sky and must not touch `fill`.

    Returns
    -------
    (N,) float64
        Interpolated inverse depth where `fill`, row by row.
    """
    texel = np.flatnonzero(fill)
    if not texel.size:
        return np.zeros(0)
    guess = _coarse_guess(inverse, known, fill, texel)
    matrix, right, diagonal = _helmholtz(inverse, known, fill, texel)
    steps = min(1000, max(40, int(_CG_TEXEL_STEPS / diagonal.size)))
    solution = _conjugate_gradients(matrix, right, diagonal, guess, steps)
    # Poorly converged corners of a ragged hole must stay near the depths around them.
    return np.clip(solution, 0.25 * guess, 4.0 * guess)


def _conjugate_gradients(
    matrix: scipy.sparse.csr_array,
    right: NDArray[np.float64],
    diagonal: NDArray[np.float64],
    start: NDArray[np.float64],
    steps: int,
) -> NDArray[np.float64]:
    """Solve a positive definite system, preconditioned by its diagonal (Jacobi).

    SciPy's solver uses BLAS for scalar products. Its threads cost more than they save on such short
    vectors: ten times the time, while other threads are at work.
    """
    x, rest = start.copy(), right - matrix @ start
    enough = (_CG_TOLERANCE**2) * _dot(right, right)
    direction, before = np.zeros_like(x), 1.0
    for _ in range(steps):
        if _dot(rest, rest) <= enough:
            break
        scaled = rest / diagonal
        now = _dot(rest, scaled)
        direction *= now / before
        direction += scaled
        image = matrix @ direction
        length = now / _dot(direction, image)
        x += length * direction
        rest -= length * image
        before = now
    return x


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return float(np.einsum("i,i", a, b))


def _helmholtz(
    inverse: NDArray[np.floating], known: Mask, fill: Mask, texel: NDArray[np.intp]
) -> tuple[scipy.sparse.csr_array, NDArray[np.float64], NDArray[np.float64]]:
    """Return matrix, right-hand side and diagonal of -(laplace + 2), by finite volumes on texels.

    Edges towards the pole have length 0 in the polar rows, so the poles need no special case.
    `texel` holds the flat indices where `fill`.
    """
    height, width = fill.shape
    step_theta, step_phi = np.pi / height, 2.0 * np.pi / width
    index = np.arange(texel.size, dtype=np.int32)
    number = np.empty(fill.size, np.int32)  # only read where `fill`
    number[texel] = index
    rows, columns = np.divmod(texel, width)
    sin_edge = np.sin(np.arange(height + 1) * step_theta)
    sin_center = np.sin((np.arange(height) + 0.5) * step_theta)
    cosine = np.cos(np.arange(height + 1) * step_theta)
    sideways = (step_theta / (sin_center * step_phi))[rows]
    diagonal = -2.0 * step_phi * (cosine[:-1] - cosine[1:])[rows]
    right = np.zeros(rows.size)
    entries, sources, targets = [], [], []
    for down, across, weight in (
        (-1, 0, (sin_edge * step_phi / step_theta)[rows]),
        (1, 0, (sin_edge * step_phi / step_theta)[rows + 1]),
        (0, -1, sideways),
        (0, 1, sideways),
    ):
        row, column = np.clip(rows + down, 0, height - 1), (columns + across) % width
        other = row * width + column
        diagonal += weight
        right += weight * np.where(known.ravel()[other], inverse.ravel()[other], 0.0)
        unknown = index[fill.ravel()[other] & (weight > 1e-12)]
        entries.append(-weight[unknown])
        sources.append(unknown)
        targets.append(number[other[unknown]])
    matrix = scipy.sparse.csr_array(
        (
            np.concatenate([*entries, diagonal]),
            (np.concatenate([*sources, index]), np.concatenate([*targets, index])),
        ),
        shape=(rows.size, rows.size),
    )
    return matrix, right, diagonal


def _coarse_guess(
    inverse: NDArray[np.floating], known: Mask, fill: Mask, texel: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the first guess (N,) where `fill`: the solution on texels of twice the size.

    A coarse texel is known, with their mean, if any of its four texels is. Known texels thus keep
    holes separate on every level.
    """
    height, width = inverse.shape
    if min(height, width) == 1:
        return np.full(texel.size, inverse[known].mean() if known.any() else 0.0)
    count = _blocks_of_four(known.view(np.uint8))
    coarse = _blocks_of_four(inverse) / np.maximum(count, np.float32(1.0))
    coarse_fill = (_blocks_of_four(fill.view(np.uint8)) > 0) & (count == 0)
    filled = fill_inverse_depth(coarse, count > 0, coarse_fill)
    guess = coarse.astype(np.float64)
    guess[coarse_fill] = filled
    return np.asarray(guess[texel // width // 2, texel % width // 2])


def _blocks_of_four(plane: NDArray[Any]) -> NDArray[Any]:
    """Return (ceil(H / 2), ceil(W / 2)) sums over blocks of 2 x 2, padded with 0."""
    height, width = plane.shape
    if height % 2 or width % 2:
        plane = np.pad(plane, [(0, height % 2), (0, width % 2)])
    rows = plane[0::2] + plane[1::2]
    return np.asarray(rows[:, 0::2] + rows[:, 1::2])
