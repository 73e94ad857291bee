"""Sanitised depth: every texel positive, holes filled or infinite, openings flagged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from iprt.footage.openings import classify_holes

Mask = NDArray[np.bool_]
Plane = NDArray[np.float32]

_CG_TOLERANCE = 1e-5
_CG_TEXEL_STEPS = 3e7
"""Unknowns times iterations spent per level: small levels converge, which leaves the large ones
only fine detail."""


@dataclass(frozen=True)
class CleanDepth:
    """Depth (H, W) float32 and flags (H, W) bool, as `Frame` holds them.

    `measured` is True where the source has a depth of its own.
    """

    depth: Plane
    opening: Mask
    measured: Mask


def sanitise_color(color: Plane) -> Plane:
    """Linear radiance with everything negative or not finite set to 0; (H, W, 3) float32."""
    usable = np.isfinite(color) & (color > 0.0)
    return np.where(usable, color, np.float32(0.0)).astype(np.float32)


def sanitise_depth(stored: Plane, color: Plane) -> CleanDepth:
    """Fill the holes that a rim closes and set the others to infinity.

    Parameters
    ----------
    stored : (H, W) float32
        Metres from the capture centre; 0, negative, NaN or inf where there is no surface.
    color : (H, W, 3) float32
        Linear radiance, finite.
    """
    measured = np.isfinite(stored) & (stored > 0.0)
    if measured.all():
        return CleanDepth(stored.astype(np.float32), np.zeros_like(measured), measured)
    holes = classify_holes(~measured, color)
    inverse = np.zeros(stored.shape)
    inverse[measured] = 1.0 / stored[measured].astype(np.float64)
    filled = fill_inverse_depth(inverse, measured, holes.opening | holes.dropout)
    with np.errstate(divide="ignore"):
        depth = np.where(measured, stored, np.where(filled > 0.0, 1.0 / filled, np.inf))
    return CleanDepth(depth.astype(np.float32), holes.opening, measured)


def find_openings(stored: Plane, color: Plane) -> Mask:
    """(H, W) bool: `CleanDepth.opening`, which is all of it that depends on colour."""
    measured = np.isfinite(stored) & (stored > 0.0)
    if measured.all():
        return np.zeros_like(measured)
    return classify_holes(~measured, color).opening


def fill_inverse_depth(
    inverse: NDArray[np.float64], known: Mask, fill: Mask
) -> NDArray[np.float64]:
    """Interpolate inverse depth smoothly over holes.

    Solves `laplace(f) + 2 f = 0` on the sphere with f given on the rim. The inverse depth of a
    plane `n . p = 1` seen along the unit vector w is f = n . w, a spherical harmonic of degree 1,
    whose Laplacian is -2 f: a hole in a plane is filled with that plane (a plain Laplacian bulges
    towards the viewer). Holes below 2 pi sr have a unique, positive solution (their lowest
    eigenvalue is above the hemisphere's, which is 2).

    Parameters
    ----------
    inverse : (H, W) float64
        1/m; read where `known`.
    known, fill : (H, W) bool
        Disjoint. Texels that are neither are open sky and must not touch `fill`.

    Returns
    -------
    (H, W) float64
        `inverse` where known, the interpolation where `fill`, 0 elsewhere.
    """
    result = np.where(known, inverse, 0.0)
    if not fill.any():
        return result
    guess = _coarse_guess(result, known, fill)
    matrix, right, diagonal = _helmholtz(result, known, fill)
    steps = min(1000, max(40, int(_CG_TEXEL_STEPS / diagonal.size)))
    solution = _conjugate_gradients(matrix, right, diagonal, guess[fill], steps)
    # Roughly solved corners of a ragged hole must not leave the range of depths around them.
    result[fill] = np.clip(solution, 0.25 * guess[fill], 4.0 * guess[fill])
    return result


def _conjugate_gradients(
    matrix: csr_array,
    right: NDArray[np.float64],
    diagonal: NDArray[np.float64],
    start: NDArray[np.float64],
    steps: int,
) -> NDArray[np.float64]:
    """Solve a positive definite system, preconditioned by its diagonal (Jacobi).

    SciPy's own takes scalar products by BLAS, whose threads cost more than they save on vectors
    this short: ten times as long, where other threads are at work.
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
    inverse: NDArray[np.float64], known: Mask, fill: Mask
) -> tuple[csr_array, NDArray[np.float64], NDArray[np.float64]]:
    """Matrix, right-hand side and diagonal of -(laplace + 2), by finite volumes on the texels.

    A texel's edges towards the pole have length 0 in the polar rows, so that the poles need no
    case of their own.
    """
    height, width = fill.shape
    step_theta, step_phi = np.pi / height, 2.0 * np.pi / width
    number = np.full(fill.shape, -1)
    number[fill] = np.arange(np.count_nonzero(fill))
    rows, columns = np.nonzero(fill)
    sin_edge = np.sin(np.arange(height + 1) * step_theta)
    sin_center = np.sin((np.arange(height) + 0.5) * step_theta)
    sideways = step_theta / (sin_center[rows] * step_phi)
    area = step_phi * (np.cos(rows * step_theta) - np.cos((rows + 1) * step_theta))
    diagonal = -2.0 * area
    right = np.zeros(rows.size)
    entries, sources, targets = [], [], []
    for down, across, weight in (
        (-1, 0, sin_edge[rows] * step_phi / step_theta),
        (1, 0, sin_edge[rows + 1] * step_phi / step_theta),
        (0, -1, sideways),
        (0, 1, sideways),
    ):
        row, column = np.clip(rows + down, 0, height - 1), (columns + across) % width
        diagonal = diagonal + weight
        rim = known[row, column]
        right += np.where(rim, weight * inverse[row, column], 0.0)
        unknown = np.nonzero(fill[row, column] & (weight > 1e-12))[0]
        entries.append(-weight[unknown])
        sources.append(unknown)
        targets.append(number[row[unknown], column[unknown]])
    index = np.arange(rows.size)
    matrix = csr_array(
        (
            np.concatenate([*entries, diagonal]),
            (np.concatenate([*sources, index]), np.concatenate([*targets, index])),
        ),
        shape=(rows.size, rows.size),
    )
    return matrix, right, diagonal


def _coarse_guess(inverse: NDArray[np.float64], known: Mask, fill: Mask) -> NDArray[np.float64]:
    """First guess (H, W): the same problem on texels of twice the size, carried back down.

    A coarse texel is known where any of its four is, with their mean, so that known texels keep
    separating holes on every level.
    """
    height, width = inverse.shape
    if min(height, width) == 1 or not fill.any():
        return np.full(inverse.shape, inverse[known].mean() if known.any() else 0.0)
    count = _blocks_of_four(known.astype(np.uint8))
    total = _blocks_of_four(np.where(known, inverse, 0.0))
    coarse_fill = (_blocks_of_four(fill.astype(np.uint8)) > 0) & (count == 0)
    coarse = fill_inverse_depth(total / np.maximum(count, 1), count > 0, coarse_fill)
    return coarse.repeat(2, axis=0).repeat(2, axis=1)[:height, :width]


def _blocks_of_four(plane: NDArray[Any]) -> NDArray[Any]:
    """(ceil(H / 2), ceil(W / 2)) sums over blocks of 2 x 2, beyond the edge of 0."""
    height, width = plane.shape
    if height % 2 or width % 2:
        plane = np.pad(plane, [(0, height % 2), (0, width % 2)])
    rows = plane[0::2] + plane[1::2]
    return np.asarray(rows[:, 0::2] + rows[:, 1::2])
