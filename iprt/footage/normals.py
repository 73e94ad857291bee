"""Estimation of surface normals from depth, by planes in windows that do not cross depth gaps.

This is the host's implementation. For rays, `cl/world/real/planes.cl` fits the same planes.

The method follows Schwandt et al., "Natural Environment Illumination", section 5: one least-squares
plane per texel, with small normal equations solved by determinants instead of an SVD. Planes are
fitted in inverse depth. With tangent coordinates (a, b) about a texel's direction, a plane
`n . p = 1` is `1 / z = n_c + n_a a + n_b b`, linear in the unknowns and exact at any slant.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from iprt.footage.depth_noise import GAP_TOLERANCE, NEAREST
from iprt.footage.threads import on_all_cores
from iprt.geometry.equirect import texel_azimuths, texel_polar_angles

Picture = NDArray[np.float32]
Index = NDArray[np.intp]
Scalar = TypeVar("Scalar", bound=np.generic)

WINDOW_REACH = 2
"""Reach of the 5 x 5 window, in texels; columns spread by 1 / sin(theta), so it stays square."""
_BLOCK = 1 << 15
"""Texels that a thread fits at a time."""
_MIN_SAMPLES = 3


def estimate_normals(depth: Picture, same: NDArray[np.uint8], tolerance: float) -> Picture:
    """Fit unit normals that face the capture centre, zero where depth is infinite.

    Parameters
    ----------
    depth : (H, W) float32
        Metres; +inf where there is no surface.
    same : (H, W) uint8
        Windows join texels of equal value only: interpolated depth bends no measured surfaces.
    tolerance : float
        `fit_tolerance` of the depth.

    Returns
    -------
    (H, W, 3) float32
    """
    height, width = depth.shape
    rows, column = max(_BLOCK // width, 1), np.arange(width)
    blocks = [
        (np.arange(first, min(first + rows, height))[:, None], column)
        for first in range(0, height, rows)
    ]
    return _fitted(blocks, depth, same, tolerance)


def estimate_normals_at(
    texel: NDArray[np.intp], depth: Picture, same: NDArray[np.uint8], tolerance: float
) -> Picture:
    """Return (N, 3) float32: `estimate_normals` of the texels with these flat indices (N,)."""
    blocks = [
        np.divmod(texel[first : first + _BLOCK], depth.shape[1])
        for first in range(0, max(texel.size, 1), _BLOCK)
    ]
    return _fitted(blocks, depth, same, tolerance)


def _fitted(
    blocks: list[tuple[Index, Index]], depth: Picture, same: NDArray[np.uint8], tolerance: float
) -> Picture:
    """Return the normals of blocks of texels, each given by its rows and columns."""
    with np.errstate(divide="ignore"):
        inverse = np.minimum(np.float32(1.0) / depth, NEAREST).astype(np.float32)
    padded_inverse, padded_same = (over_poles(one, WINDOW_REACH) for one in (inverse, same))

    def fit(block: tuple[Index, Index]) -> Picture:
        normal = _Window(padded_inverse, padded_same, *block).fit_planes(tolerance)
        return np.where(inverse[block][..., None] > 0.0, normal, np.float32(0.0))

    return np.concatenate(on_all_cores(fit, blocks))


def sanitize_normals(given: Picture, estimate: Picture) -> Picture:
    """Normalise given normals and turn them to the centre; fill gaps with the estimate.

    Parameters
    ----------
    given : (H, W, 3) float32
        As read: any length, possibly NaN or zero.
    estimate : (H, W, 3) float32
        From `estimate_normals`; zero marks texels without a surface, which get no normal.

    Returns
    -------
    (H, W, 3) float32
    """
    height, width = given.shape[:2]
    sin_theta, cos_theta, sin_phi, cos_phi = _frame_angles(width, height)
    x, y, z = given[..., 0], given[..., 1], given[..., 2]
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        length = np.sqrt(x * x + y * y + z * z)
        usable = (length > 0.1) & np.isfinite(length) & np.any(estimate != 0.0, axis=-1)
        away = sin_theta * (x * sin_phi - z * cos_phi) + y * cos_theta > 0.0
        facing = given * np.where(away, -1.0 / length, 1.0 / length)[..., None]
    return np.where(usable[..., None], facing, estimate).astype(np.float32)


def column_spread(width: int, height: int) -> NDArray[np.intp]:
    """Return (H,) columns per step of the window: 1 at the equator, up to W / 8 at the poles."""
    ratio = (width / (2.0 * height)) / np.sin(texel_polar_angles(height))
    return np.clip(np.rint(ratio), 1, max(1, width // 8)).astype(np.intp)


@lru_cache(maxsize=4)
def _window_tables(
    width: int, height: int
) -> dict[tuple[int, int], tuple[Picture, Picture, Picture]]:
    """Return the scale of 1/z and tangent coordinates a, b of each row, by steps down and aside.

    Each is (H,) float32. A neighbour more than about 75° away gets a scale that fits no plane.
    """
    step = np.pi / height
    theta = (np.arange(height) + 0.5) * step
    spread = column_spread(width, height)
    tables = {}
    reach = range(-WINDOW_REACH, WINDOW_REACH + 1)
    for down, steps in ((d, s) for d in reach for s in reach):
        phi = steps * spread * 2.0 * np.pi / width
        to = theta + down * step
        ahead = np.cos(theta) * np.cos(to) + np.sin(theta) * np.sin(to) * np.cos(phi)
        across = np.sin(to) * np.sin(phi)
        up = np.sin(theta) * np.cos(to) - np.cos(theta) * np.sin(to) * np.cos(phi)
        ahead = np.where(ahead > 0.25, ahead, 1e-6)
        columns = (1.0 / ahead, across / ahead, up / ahead)
        scale, a, b = (column.astype(np.float32) for column in columns)
        tables[down, steps] = scale, a, b
    return tables


@dataclass(frozen=True)
class Tap:
    """One texel of the windows of all rows; arrays are (H,).

    Attributes
    ----------
    row, columns : int
        Row, and number of columns to the right of the window's centre.
    scale : float32
        Factor of 1/z. More than about 75° away, it fits no plane.
    a, b : float32
        Tangent coordinates about the centre.
    """

    row: NDArray[np.intp]
    columns: NDArray[np.intp]
    scale: Picture
    a: Picture
    b: Picture


def window_taps(width: int, height: int) -> list[Tap]:
    """Return the texels of the windows of `estimate_normals`, row by row."""
    spread, rows = column_spread(width, height), np.arange(height)
    taps = []
    for (down, steps), tables in _window_tables(width, height).items():
        cycle = np.mod(rows + down, 2 * height)
        beyond = cycle >= height
        row = np.where(beyond, 2 * height - 1 - cycle, cycle)
        columns = steps * spread - np.where(beyond, width // 2, 0)
        taps.append(Tap(row, columns, *tables))
    return taps


def over_poles(plane: NDArray[Scalar], rows: int) -> NDArray[Scalar]:
    """Pad to (H + 2 rows, W, ...) over the poles, where columns continue half a turn away."""
    height, width = plane.shape[:2]
    cycle = np.mod(np.arange(-rows, height + rows), 2 * height)
    beyond = cycle >= height
    extended: NDArray[Scalar] = plane[np.where(beyond, 2 * height - 1 - cycle, cycle)]
    extended[beyond] = np.roll(extended[beyond], width // 2, axis=1)
    return extended


def _frame_angles(width: int, height: int) -> tuple[Picture, Picture, Picture, Picture]:
    """Return sin and cos of theta (H, 1) and phi (W,) at texel centres."""
    theta, phi = texel_polar_angles(height)[:, None], texel_azimuths(width)
    tables = (np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi))
    sin_theta, cos_theta, sin_phi, cos_phi = (table.astype(np.float32) for table in tables)
    return sin_theta, cos_theta, sin_phi, cos_phi


class _Window:
    """The windows around some texels, in tangent coordinates.

    Parameters
    ----------
    inverse : (H + 2 reach, W) float32
        Inverse depth, padded over the poles.
    same : (H + 2 reach, W) uint8
        `same` of `estimate_normals_at`, padded like `inverse`.
    row, column : int
        Indices of the texels in the unpadded picture; their shapes broadcast.
    """

    def __init__(
        self, inverse: Picture, same: NDArray[np.uint8], row: Index, column: Index
    ) -> None:
        height, width = inverse.shape[0] - 2 * WINDOW_REACH, inverse.shape[1]
        self._height, self._width, self._row, self._column = height, width, row, column
        aside = column_spread(width, height)[row]
        reach = range(-WINDOW_REACH, WINDOW_REACH + 1)
        columns = {steps: (column + steps * aside) % width for steps in reach}
        self._start = {steps: row * width + columns[steps] for steps in reach}
        self._inverse, self._same = inverse.ravel(), same.ravel()
        self._tables = _window_tables(width, height)
        # Where all texels within reach are of one kind, windows need not compare them.
        near = same[row.min(initial=height) : row.max(initial=0) + 2 * WINDOW_REACH + 1]
        self._joined = near.min(initial=255) == near.max(initial=0)
        self._center = self._shifted(self._inverse, 0, 0)

    def fit_planes(self, tolerance: float) -> Picture:
        """Return unit normals (..., 3) that face the centre; local slopes where too few fit."""
        slope_b = self._slope([self._sample(down, 0) for down in (2, 1, -1, -2)], axis=2)
        parallel = [self._sample(0, steps) for steps in (-2, -1, 1, 2)]
        # A parallel deviates from the great circle, so its texels do not lie at b = 0.
        level = [(rise - slope_b * b, a, b) for rise, a, b in parallel]
        slope_a = self._slope(level, axis=1)
        sums = self._sums(slope_a, slope_b, np.float32(tolerance) * self._center)
        n, a, b, aa, ab, bb, f, af, bf = sums
        # Moments about the mean: the plane need not pass through the texel itself.
        aa, ab, bb = aa - a * a / n, ab - a * b / n, bb - b * b / n
        af, bf = af - a * f / n, bf - b * f / n
        determinant = aa * bb - ab * ab
        solvable = (n >= _MIN_SAMPLES) & (determinant > 1e-3 * (aa + bb) ** 2)
        solvable &= determinant > np.finfo(np.float32).tiny
        scale = 1.0 / np.where(solvable, determinant, 1.0)
        across, up = (bb * af - ab * bf) * scale, (aa * bf - ab * af) * scale
        ahead = self._center + (f - across * a - up * b) / n
        solvable &= ahead > 0.0
        return self._to_world(
            np.where(solvable, across, slope_a),
            np.where(solvable, up, slope_b),
            np.where(solvable, ahead, np.where(self._center > 0.0, self._center, 1.0)),
        )

    def _sums(self, slope_a: Picture, slope_b: Picture, tolerance: Picture) -> list[Picture]:
        """Return count and moments of a, b and inverse depth over the texels on the local plane.

        Two texels at opposite steps aside have opposite a and the same b, and are summed as pairs.
        """
        shape = self._center.shape
        sums = [np.zeros(shape, np.float32) for _ in range(9)]
        n, sum_a, sum_b, sum_aa, sum_ab, sum_bb, sum_f, sum_af, sum_bf = sums
        n += 1.0
        reach = range(-WINDOW_REACH, WINDOW_REACH + 1)
        product = np.empty(shape, np.float32)
        for down, steps in (
            (d, s) for d in reach for s in range(WINDOW_REACH + 1) if (d, s) != (0, 0)
        ):
            both, rise, a, b = self._on_plane(down, steps, slope_a, slope_b, tolerance)
            if steps:
                weight, other, _, _ = self._on_plane(down, -steps, slope_a, slope_b, tolerance)
                difference, slant = both - weight, rise - other
                both += weight
                rise += other
                for total, moment in (
                    (sum_a, difference),
                    (sum_ab, b * difference),
                    (sum_af, slant),
                ):
                    np.multiply(moment, a, out=product)
                    total += product
            n += both
            sum_f += rise
            for total, factor, moment in (
                (sum_b, b, both),
                (sum_bb, b * b, both),
                (sum_bf, b, rise),
                (sum_aa, a * a, both),
            ):
                np.multiply(moment, factor, out=product)
                total += product
        return sums

    def _on_plane(
        self, down: int, steps: int, slope_a: Picture, slope_b: Picture, tolerance: Picture
    ) -> tuple[Picture, Picture, Picture, Picture]:
        """Return whether a window's texel is on the local plane (0 or 1), its rise, a and b."""
        rise, a, b = self._sample(down, steps)
        off = slope_a * a
        np.subtract(rise, off, out=off)
        off -= slope_b * b
        np.abs(off, out=off)
        member = off <= tolerance
        if not self._joined:
            own = self._shifted(self._same, 0, 0)
            member &= self._shifted(self._same, down, steps) == own
        weight = member.astype(np.float32)
        rise *= weight
        return weight, rise, a, b

    def _slope(self, line: list[tuple[Picture, Picture, Picture]], axis: int) -> Picture:
        """Return the slope of inverse depth along a line of samples.

        It is the mean of both sides' slopes if they differ by no more than twice the smaller bend.
        Else, at an edge, it is the slope of the smoother side, as in ENO schemes. It is 0 with gaps
        on both sides.

        Parameters
        ----------
        line : list of (rise, a, b)
            Samples at -2, -1, +1 and +2 steps.
        axis : int
            1 for a, 2 for b.
        """
        sides = []
        for far, near in ((line[0], line[1]), (line[3], line[2])):
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                slope = near[0] / near[axis]
                bend = np.abs((far[0] - near[0]) / (far[axis] - near[axis]) - slope)
            sides.append((slope, bend))
        (before, before_bend), (after, after_bend) = sides
        smooth = np.abs(before - after) <= 2.0 * np.minimum(before_bend, after_bend)
        one_sided = np.where(before_bend <= after_bend, before, after)
        step = np.maximum(np.abs(line[1][axis]), np.abs(line[2][axis]))
        surface = np.fmin(before_bend, after_bend) * step <= GAP_TOLERANCE[1] * self._center
        slope = np.where(smooth, 0.5 * (before + after), one_sided)
        return np.where(surface & np.isfinite(slope), slope, np.float32(0.0))

    def _sample(self, down: int, steps: int) -> tuple[Picture, Picture, Picture]:
        """Return the rise of 1/z over the centre, and tangent coordinates a, b.

        A neighbour more than about 75° away gets a rise that fits no plane.
        """
        scale, a, b = (table[self._row] for table in self._tables[down, steps])
        rise: Picture = self._shifted(self._inverse, down, steps) * scale
        rise -= self._center
        return rise, a, b

    def _shifted(self, plane: NDArray[Scalar], down: int, steps: int) -> NDArray[Scalar]:
        """Return texels of a flat padded plane, at these rows and steps from the centres."""
        start = self._start[steps] + (WINDOW_REACH + down) * self._width
        return np.asarray(plane.take(start))

    def _to_world(self, across: Picture, up: Picture, ahead: Picture) -> Picture:
        """Return unit vectors facing the centre, from components east, north and away from it."""
        sin_theta, cos_theta, sin_phi, cos_phi = _frame_angles(self._width, self._height)
        sin_theta, cos_theta = sin_theta[:, 0][self._row], cos_theta[:, 0][self._row]
        sin_phi, cos_phi = sin_phi[self._column], cos_phi[self._column]
        scale = -1.0 / np.sqrt(across * across + up * up + ahead * ahead)
        across, up, ahead = across * scale, up * scale, ahead * scale
        outward = ahead * sin_theta - up * cos_theta
        return np.stack(
            [
                outward * sin_phi + across * cos_phi,
                ahead * cos_theta + up * sin_theta,
                across * sin_phi - outward * cos_phi,
            ],
            axis=-1,
        )
