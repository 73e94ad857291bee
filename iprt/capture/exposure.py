"""Exposure, white balance and vignetting of frames, by the surfaces that several have seen.

Gains per frame and channel, and one vignette for all, are found at once: a chain from each frame to
the next would add up what vignetting makes of each. After Goldman & Chen, "Vignette and Exposure
Calibration and Compensation" (ICCV 2005), with the response known (sRGB).
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
"""Frames with the most similar views that each is compared with, beside those 1, 2, 4, 8... on."""
CELLS = 128
"""Cells of a pair of frames that are compared, at most."""
ALIKE = 8
"""Cells whose errors are taken to be one: textures and lights are larger than cells."""
STEPS = 8
WIDEST, NARROWING = 1.0, 0.6
"""Error of a logarithm at which a cell's weight is a quarter, at first, and what it is multiplied
by from one step to the next: from all cells to those that agree (graduated non-convexity)."""
NARROWEST, BEYOND_NOISE = 0.02, 3.0
"""It ends at this error, or at so many median ones."""
LIKELY_CHANGE, LIKELY_VIGNETTE = 0.3, 0.3
"""Standard deviations, known beforehand, of the logarithms of one frame's gain over the one before,
and of the terms of the vignette in the pictures' corners."""
DARK = 1e-3
"""Radiance that counts as no less, as a share of the median."""
UNMATCHED = 0.35
"""A frame whose colours are further off in the median, in logarithms, does not match."""
ENOUGH = 60
"""With fewer cells to compare, nothing speaks against a frame."""
MAX_GAIN = 16.0
"""Frames brighter or darker than the median by more are left out."""
MAX_LEFT_OUT = 1 / 3
"""Where more of the frames do not match, it is the matching that is wrong."""

Matrix = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Exposures:
    """What brings frames to the colours of the first that matches.

    Attributes
    ----------
    gain : (N, 3) float64
        Factors of the frames' linear radiance.
    vignette : (2, 3) float64
        Logarithms of the brightness in the corners, over that in the middle: of the terms in r^2
        and r^4.
    left_out : frozenset of int
        Frames that do not match the others.
    trusted : bool
        False: most did not match, and the gains are 1.
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
        """Return a frame's colours (H, W, 3) in the exposure of the first."""
        vignette = np.exp(-_radial(camera) @ self.vignette)
        return np.asarray(color * (self.gain[index] * vignette), np.float32)


def match_exposures(glances: list[Glance], poses: Matrix) -> Exposures:
    """Find gains by which frames agree about the surfaces they share.

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
    """Cells that two frames have seen: of which frames, the logarithm of the second's radiance
    over the first's, the same of the vignette's terms, and how much they count.
    """

    first: Indices
    second: Indices
    change: Matrix
    radial: Matrix
    share: Matrix

    @classmethod
    def of(cls, glances: list[Glance], poses: Matrix) -> _Comparisons:
        random = np.random.default_rng(0)
        seen = np.concatenate([glance.color[glance.depth > 0.0] for glance in glances])
        lit = seen[np.isfinite(seen).all(axis=1)]
        dark = max(DARK * float(np.median(lit)), 1e-12) if len(lit) else 1.0
        radial = [_radial(glance.camera).astype(np.float32) for glance in glances]
        empty = np.zeros(0, np.intp)
        parts = [(empty, empty, np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0))]
        for i, j in _pairs(poses):
            turn = np.linalg.inv(poses[j]) @ poses[i]
            both = overlap(glances[i], glances[j], turn)
            chosen = np.flatnonzero(both.agree)
            chosen = random.permutation(chosen)[:CELLS]
            cell, column, row = both.cell[chosen], both.column[chosen], both.row[chosen]
            seen = glances[i].color.reshape(-1, 3)[cell]
            there = sampled(np.concatenate([glances[j].color, radial[j]], -1), column, row)
            known = np.isfinite(seen + there[:, :3]).all(axis=1)
            known &= np.maximum(seen, there[:, :3]).max(axis=1) > dark
            seen, there, cell = seen[known], there[known], cell[known]
            change = np.log(np.maximum(there[:, :3], dark) / np.maximum(seen, dark))
            terms = there[:, 3:] - radial[i].reshape(-1, 2)[cell]
            number = np.full(len(cell), 1, np.intp)
            share = np.full(len(cell), 1.0 / ALIKE)
            parts.append((i * number, j * number, change, terms, share))
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def solve(self, count: int) -> tuple[Matrix, Matrix, Matrix]:
        """Return logarithms of brightness (count, 3), of the vignette (2, 3), and errors (rows,).

        Robust least squares, with weights that narrow from all cells to those that agree.
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
            weighted = design.multiply((self.share * weight)[:, None]).T.tocsr()
            found = spsolve((weighted @ design + known).tocsc(), weighted @ self.change)
            residual = design @ found - self.change
            error = np.sqrt((residual * residual).mean(axis=1))
            noise = max(BEYOND_NOISE * float(np.median(error)), NARROWEST)
            width = max(NARROWING * width, noise)
            weight = (width / (width * width + error * error)) ** 2
        return found[:count], found[count:], error

    def unmatched(self, error: Matrix, without: set[int]) -> set[int]:
        """Return frames whose colours differ from those of the others, the worst one first."""
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
    """Frames that may have seen the same: some behind one another, and similar views."""
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
    """Return (H, W, 2) squares and fourth powers of the distance from the middle; 1 in corners."""
    y, x = np.indices((camera.height, camera.width))
    square = (x - (camera.width - 1) / 2) ** 2 + (y - (camera.height - 1) / 2) ** 2
    square = square / ((camera.width / 2) ** 2 + (camera.height / 2) ** 2)
    return np.stack([square, square * square], axis=-1)
