"""Exposure, white balance and vignetting of frames, from surfaces seen by several frames.

Gains per frame and channel, and one vignette for all, are solved for jointly: chaining each frame
to the next would accumulate errors from vignetting. After Goldman & Chen, "Vignette and Exposure
Calibration and Compensation" (ICCV 2005), with a known response (sRGB).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from iprt.capture.overlap import Glance, overlap
from iprt.capture.pinhole import Pinhole, sampled

NEAREST = 8
"""Number of similar views to compare each frame with, besides the frames 1, 2, 4, 8... later."""
CELLS = 128
"""Most cells that are compared in a pair of frames."""
ALIKE = 8
"""Number of cells with correlated errors, as textures and lights are larger than cells."""
STEPS = 8
WIDEST, NARROWING = 1.0, 0.6
"""Initial width of the error kernel, in logarithms, and its factor per step (graduated
non-convexity). A cell whose error equals the width has a quarter of the weight."""
NARROWEST, BEYOND_NOISE = 0.02, 3.0
"""Least width, and least width in median errors; the larger one counts."""
LIKELY_CHANGE, LIKELY_VIGNETTE = 0.3, 0.3
"""Prior standard deviations of the logarithms of a frame's gain over the previous frame's, and of
the vignette's terms in the corners of the pictures."""
DARK = 1e-3
"""Lower bound of compared radiance, as a share of the median."""
UNMATCHED = 0.35
"""Median error, in logarithms, above which a frame does not match."""
ENOUGH = 60
"""Fewest compared cells that can speak against a frame."""
MAX_GAIN = 16.0
"""Factor above or below the median brightness beyond which a frame is left out."""
MAX_LEFT_OUT = 1 / 3
"""Share of unmatched frames above which the matching itself is rejected."""

Matrix = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Exposures:
    """Corrections that bring frames to the colors of the first matching frame.

    Attributes
    ----------
    gain : (N, 3) float64
        Factors for the frames' linear radiance.
    vignette : (2, 3) float64
        Terms in r^2 and r^4 of the logarithm of the corners' brightness over the middle's.
    left_out : frozenset of int
        Frames that do not match the others.
    trusted : bool
        False if too many frames did not match; the gains are 1 then.
    """

    gain: Matrix
    vignette: Matrix
    left_out: frozenset[int] = frozenset()
    trusted: bool = True

    @classmethod
    def as_they_are(cls, frames: int, *, trusted: bool = True) -> Exposures:
        """Return gains of 1 for all frames."""
        return cls(np.ones((frames, 3)), np.zeros((2, 3)), trusted=trusted)

    def matched(self, index: int, color: Float, camera: Pinhole) -> Float:
        """Return a frame's colors (H, W, 3) in the exposure of the first."""
        vignette = np.exp(-_radial(camera) @ self.vignette)
        return np.asarray(color * (self.gain[index] * vignette), np.float32)


def match_exposures(glances: list[Glance], poses: Matrix) -> Exposures:
    """Estimate the gains that make frames agree on shared surfaces.

    Parameters
    ----------
    poses : (N, 4, 4) float64
        World from camera, in OpenCV's axes.
    """
    count = len(glances)
    rows = _Comparisons.of(glances, poses)
    if not len(rows.first):
        return Exposures.as_they_are(count)
    gains, vignette, error = rows.solve(count)
    off = np.abs(gains - np.median(gains, axis=0)).max(axis=1)
    left_out = set(np.flatnonzero(off > np.log(MAX_GAIN)).tolist())
    left_out |= rows.unmatched(error, left_out)
    if len(left_out) > MAX_LEFT_OUT * count:
        return Exposures.as_they_are(count, trusted=False)
    first = min(set(range(count)) - left_out)
    return Exposures(np.exp(gains[first] - gains), vignette, frozenset(left_out))


@dataclass(frozen=True)
class _Comparisons:
    """Cells seen by two frames.

    Each has the two frames, the logarithm of the second's radiance over the first's, and the
    difference of the vignette's terms.
    """

    first: Indices
    second: Indices
    change: Matrix
    radial: Matrix

    @classmethod
    def of(cls, glances: list[Glance], poses: Matrix) -> _Comparisons:
        random = np.random.default_rng(0)
        seen = np.concatenate([glance.color[glance.depth > 0.0] for glance in glances])
        lit = seen[np.isfinite(seen).all(axis=1)]
        dark = max(DARK * float(np.median(lit)), 1e-12) if len(lit) else 1.0
        radial = [_radial(glance.camera).astype(np.float32) for glance in glances]
        empty = np.zeros(0, np.intp)
        parts = [(empty, empty, np.zeros((0, 3)), np.zeros((0, 2)))]
        for i, j in _pairs(poses):
            turn = np.linalg.inv(poses[j]) @ poses[i]
            both = overlap(glances[i], glances[j], turn)
            chosen = random.permutation(np.flatnonzero(both.agree))[:CELLS]
            cell, column, row = both.cell[chosen], both.column[chosen], both.row[chosen]
            seen = glances[i].color.reshape(-1, 3)[cell]
            there = sampled(np.concatenate([glances[j].color, radial[j]], -1), column, row)
            known = np.isfinite(seen + there[:, :3]).all(axis=1)
            known &= np.maximum(seen, there[:, :3]).max(axis=1) > dark
            seen, there, cell = seen[known], there[known], cell[known]
            change = np.log(np.maximum(there[:, :3], dark) / np.maximum(seen, dark))
            terms = there[:, 3:] - radial[i].reshape(-1, 2)[cell]
            first, second = (np.full(len(cell), frame, np.intp) for frame in (i, j))
            parts.append((first, second, change, terms))
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def solve(self, count: int) -> tuple[Matrix, Matrix, Matrix]:
        """Return log brightness (count, 3), log vignette (2, 3) and the errors (rows,).

        The solver is robust least squares, with weights that narrow to the agreeing cells.
        """
        row = np.arange(len(self.first))
        place = np.concatenate([row, row, row, row])
        column = np.concatenate(
            [self.second, self.first, np.full_like(row, count), np.full_like(row, count + 1)]
        )
        ones = np.ones(len(row))
        value = np.concatenate([ones, -ones, self.radial[:, 0], self.radial[:, 1]])
        design = sparse.csr_matrix((value, (place, column)), (len(row), count + 2))
        step = sparse.diags([1.0, -1.0], [0, 1], (count - 1, count + 2))
        known = (step.T @ step) / LIKELY_CHANGE**2
        vignette = np.r_[np.full(count, 1e-6), 1.0, 1.0] / LIKELY_VIGNETTE**2
        known = known + sparse.diags(vignette)
        weight, width = np.full(len(row), 1.0 / WIDEST**2), WIDEST
        for _ in range(STEPS):
            weighted = design.multiply((weight / ALIKE)[:, None]).T.tocsr()
            found = spsolve((weighted @ design + known).tocsc(), weighted @ self.change)
            residual = design @ found - self.change
            error = np.sqrt((residual * residual).mean(axis=1))
            noise = max(BEYOND_NOISE * float(np.median(error)), NARROWEST)
            width = max(NARROWING * width, noise)
            weight = (width / (width * width + error * error)) ** 2
        return found[:count], found[count:], error

    def unmatched(self, error: Matrix, without: set[int]) -> set[int]:
        """Return frames whose colors differ from the others', removing the worst one first."""
        left_out: set[int] = set()
        while True:
            gone = list(left_out | without)
            kept = ~np.isin(self.first, gone) & ~np.isin(self.second, gone)
            frame = np.concatenate([self.first[kept], self.second[kept]])
            errors = np.concatenate([error[kept], error[kept]])
            order = np.lexsort((errors, frame))
            frame, errors = frame[order], errors[order]
            names, starts, counts = np.unique(frame, return_index=True, return_counts=True)
            median = np.where(counts >= ENOUGH, errors[starts + counts // 2], 0.0)
            if not len(names) or median.max() <= UNMATCHED:
                return left_out
            left_out.add(int(names[np.argmax(median)]))


def _pairs(poses: Matrix) -> list[tuple[int, int]]:
    """Return pairs of frames that may overlap: 1, 2, 4... apart, or with similar views."""
    count = len(poses)
    pairs: set[tuple[int, int]] = set()
    lag = 1
    while lag < count:
        pairs.update((i, i + lag) for i in range(count - lag))
        lag *= 2
    ahead, position = poses[:, :3, 2], poses[:, :3, 3]
    for i in range(count):
        apart = 1.0 - ahead @ ahead[i] + np.linalg.norm(position - position[i], axis=1)
        apart[i] = np.inf
        pairs.update((min(i, j), max(i, j)) for j in map(int, np.argsort(apart)[:NEAREST]))
    return sorted((i, j) for i, j in pairs if i != j)


def _radial(camera: Pinhole) -> Matrix:
    """Return r^2 and r^4 (H, W, 2) of the distance r from the centre; r is 1 in the corners."""
    y, x = np.indices((camera.height, camera.width))
    square = (x - (camera.width - 1) / 2) ** 2 + (y - (camera.height - 1) / 2) ** 2
    square = square / ((camera.width / 2) ** 2 + (camera.height / 2) ** 2)
    return np.stack([square, square * square], axis=-1)
