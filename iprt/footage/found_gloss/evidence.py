"""Statistical evidence of gloss: regression of a plane's radiance on a coat's reflection.

The camera sees radiance

    L = ρ E / π + k S(α)

on a plane's cells, with E the irradiance and S the reflection towards the camera by a coat of
roughness α and index of refraction 1.5 (`coat_reflection`). k is its strength. The reflectance ρ
varies by textures that are independent of S. Local means are subtracted from L, E and S, which
leaves variation over a few degrees. L and S are then divided by the local mean of L, and E by its
own. A robust regression (Huber) over cells and colors estimates k, and factors on E, separately
for lights and for all other light. Cells that the model does not explain, such as the rim of a
sunny patch, are left out, also from the means.

Light recovered from clipped texels has a k of its own. Its radiance is an estimate, which may be
several times too low, so a common k would not fit both the window and the walls beside it.

The standard error of k counts each block of cells as one observation (cluster-robust sandwich;
Huber 1967, White 1980), because neighbouring errors are correlated. α minimises the cost of the
regression, by a parabola through the best of `ALPHAS` and its neighbours. Its uncertainty is
a jackknife estimate over the same blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.cells import Cells, Float
from iprt.footage.coat_reflection import RECOVERED
from iprt.footage.found_gloss.cell_means import MeansAround
from iprt.footage.found_gloss.regression import (
    HUBER,
    deviation_of,
    effective_blocks,
    least_squares,
    lowest,
    robust_weights,
)

ALPHAS = (0.02, 0.03, 0.05, 0.08, 0.13, 0.2, 0.3)
"""Values of GGX roughness to test; see `resolved`. Rougher reflections are as smooth as shading."""
RESOLVED = 0.7
"""Least roughness that cells resolve, relative to their height in rad."""
AROUND = np.deg2rad(5.6)
"""Standard deviation of the Gaussian for local means, in rad."""
LOBE = 0.3
"""Standard deviation of the Gaussian that denoises S, relative to α."""
LEAST = 0.3
"""Least standard deviation of that Gaussian, in cells."""
SMOOTH = np.deg2rad(2.25)
"""Standard deviation of the Gaussian that smooths E, which is computed for every other cell."""
SHARPER = 1.2
"""Correction of the best-fitting α, which is biased low: shading and local means absorb a part of a
wide reflection. Measured in rooms with known gloss; 1.0 to 1.7 in single ones."""
BLOCK, BLOCKS = np.deg2rad(11.25), 25
"""Largest side of a block of cells, in rad, and least number of blocks in a plane."""
ODD = 4.0
"""Residuals, in standard deviations, beyond which cells do not count."""
MAX_BEYOND = 0.3
"""Share of the cells that may be darker than the reflection: mats and plates on a table."""
STEPS, ROUNDS = 8, 3


@dataclass(frozen=True)
class Fit:
    """Result of the regression for one roughness.

    Attributes
    ----------
    strength : float
        k, for the kind of light with the larger t.
    error : float
        Standard error of k.
    explained : float
        Share of the squared residuals after E that S explains.
    blocks : float
        Effective number of blocks of cells, see `effective_blocks`.
    recovered : bool
        Whether k belongs to light recovered from clipped texels.
    """

    strength: float
    error: float
    explained: float
    blocks: float
    recovered: bool = False

    @property
    def t(self) -> float:
        """Student's t of the strength."""
        return self.strength / self.error if self.error > 0.0 else 0.0

    def chance(self, tries: int) -> float:
        """Return the probability of such a t, as the best of `tries`, without any reflection."""
        return min(1.0, tries * float(scipy.special.stdtr(max(self.blocks - 1.0, 1.0), -self.t)))


@dataclass(frozen=True)
class Reflection:
    """Estimate of a plane's reflection.

    Attributes
    ----------
    alpha : float
        Roughness.
    spread : float
        Factor of one standard deviation of α, at least 1.
    fit : Fit
        Best fit among `ALPHAS`.
    """

    alpha: float
    spread: float
    fit: Fit


@dataclass(frozen=True)
class Later:
    """A later frame's view of a plane's n cells, divided by the gain of its exposure.

    Attributes
    ----------
    color : (n, 3) float64
        Radiance.
    irradiance : (K, n, 3) float64
        Irradiance by K kinds of light.
    seen : (n,) bool
        Where the frame shows the plane.
    """

    color: Float
    irradiance: Float
    seen: NDArray[np.bool_]


@dataclass(frozen=True)
class _Rows:
    """One frame's rows of the regressions for all roughnesses, for the m cells that are kept.

    Attributes
    ----------
    cells : (m,) int
        Indices of the cells on the plane.
    around : (m, 3) float64
        Local means of L in the first frame.
    y : (3 m,) float64
        L minus its local mean, divided by `around`. For later frames, L is the difference from the
        first frame.
    shading : (3 m, J) float64
        Regressors for shading.
    weight, block : (3 m,)
        Solid angles relative to their mean; block indices.
    """

    cells: NDArray[np.intp]
    around: Float
    y: Float
    shading: Float
    weight: Float
    block: NDArray[np.intp]


def resolved(rows: int) -> tuple[float, ...]:
    """Return the values of `ALPHAS` whose lobes cells of `rows` rows resolve."""
    return tuple(alpha for alpha in ALPHAS if alpha >= RESOLVED * np.pi / rows)


class PlanePicture:
    """Radiance and irradiance of a plane's cells, for regression on its reflection.

    Parameters
    ----------
    cells : Cells
        Cells of the first frame.
    on : (n,) int
        Indices of the plane's cells.
    color : (N, 3) float64
        Radiance of all cells.
    irradiance : (K, n, 3) float64
        Irradiance by K kinds of light.
    later : sequence of Later
        Other frames.
    """

    def __init__(
        self,
        cells: Cells,
        on: NDArray[np.intp],
        color: Float,
        irradiance: Float,
        later: Sequence[Later] = (),
    ) -> None:
        self._rows, self._means = cells.rows, MeansAround(cells.rows, on)
        self._color, self._later = color[on], later
        self._weight = cells.solid_angle[on] / cells.solid_angle[on].mean()
        block_side = min(BLOCK, np.sqrt(cells.solid_angle[on].sum() / BLOCKS))
        side = max(1, round(block_side * cells.rows / np.pi))
        row, column = np.divmod(on, 2 * cells.rows)
        _, block = np.unique(row // side * 2 * cells.rows + column // side, return_inverse=True)
        self._block = block.astype(np.intp)
        self._whole = np.ones(len(on), bool)
        self._kept = [self._whole.copy(), *(frame.seen.copy() for frame in later)]
        self._irradiance = self._even(irradiance)
        self._more_light = [self._even(frame.irradiance) - self._irradiance for frame in later]

    def fit(self, reflected: Float, alpha: float) -> Fit:
        """Fit the strength of a coat of roughness `alpha`.

        Parameters
        ----------
        reflected : (1 + frames, KINDS, n, 3) float64
            Its reflected radiance at unit strength.
        alpha : float
        """
        return self._fit(self._varied(), self._smooth(reflected, alpha))[0]

    def reflection(self, reflected: Sequence[Float]) -> Reflection:
        """Estimate roughness and strength of the reflection.

        Parameters
        ----------
        reflected : sequence of (1 + frames, KINDS, n, 3) float64
            Reflected radiance of coats of the `resolved` roughnesses, at unit strength.
        """
        alphas = resolved(self._rows)
        smooth = [self._smooth(part, alpha) for alpha, part in zip(alphas, reflected, strict=True)]
        for _ in range(ROUNDS):
            varied = self._varied()
            fits = [self._fit(varied, part) for part in smooth]
            _, left = fits[int(np.argmax([fit.explained for fit, _ in fits]))]
            for kept, rows, rest in zip(self._kept, varied, left, strict=True):
                kept[rows.cells[np.abs(rest).max(axis=-1) > ODD * deviation_of(rest)]] = False
        return self._reflection(smooth, np.log(alphas))

    def _smooth(self, reflected: Float, alpha: float) -> list[Float]:
        deviation = max(LOBE * alpha * self._rows / np.pi, LEAST)
        return [self._means(part, self._whole, deviation) for part in reflected]

    def _even(self, irradiance: Float) -> Float:
        return self._means(irradiance, self._whole, SMOOTH * self._rows / np.pi)

    def _around(self, parts: Float, frame: int) -> Float:
        """Return means (K, n, 3) over the cells that are kept in a frame."""
        return self._means(parts, self._kept[frame], AROUND * self._rows / np.pi)

    def _varying(self, parts: Float, frame: int) -> Float:
        """Return (K, m, 3) the kept cells of a frame minus their local means."""
        return np.asarray((parts - self._around(parts, frame))[:, self._kept[frame]])

    def _varied(self) -> list[_Rows]:
        lights = self._irradiance.sum(0)
        seen, lit = np.maximum(self._around(np.stack([self._color, lights]), 0), 1e-12)
        kinds = len(self._irradiance)
        columns = 2 * kinds + len(self._later) if self._later else kinds
        rows = []
        for frame, kept in enumerate(self._kept):
            around = seen[kept]
            shading = np.zeros((around.size, columns))
            if frame == 0:
                varying, *light = self._varying(
                    np.concatenate([self._color[None], self._irradiance]), 0
                )
                for kind, part in enumerate(light):
                    shading[:, kind] = (part / lit[kept]).ravel()
            else:
                change = self._later[frame - 1].color - self._color
                painted = self._more_light[frame - 1] / lit * self._color
                varying, own, *light = self._varying(
                    np.concatenate([[change, self._color], painted]), frame
                )
                for kind, part in enumerate(light):
                    shading[:, kinds + kind] = (part / around).ravel()
                shading[:, 2 * kinds + frame - 1] = (own / around).ravel()
            rows.append(
                _Rows(
                    cells=np.flatnonzero(kept),
                    around=around,
                    y=(varying / around).ravel(),
                    shading=shading,
                    weight=np.repeat(self._weight[kept], 3),
                    block=np.repeat(self._block[kept], 3),
                )
            )
        return rows

    def _fit(
        self, varied: Sequence[_Rows], reflected: Sequence[Float], *, bounded: bool = False
    ) -> tuple[Fit, list[Float]]:
        """Fit by iteratively reweighted least squares; return residuals (m, 3) by frame, too.

        A bounded fit is no stronger than the radiance of most cells allows.
        """
        y, own, block = (
            np.concatenate([getattr(rows, name) for rows in varied])
            for name in ("y", "weight", "block")
        )
        kinds, parts = len(reflected[0]), []
        for frame, (rows, part) in enumerate(zip(varied, reflected, strict=True)):
            change = part if frame == 0 else part - reflected[0]
            varying = self._varying(change, frame) / rows.around
            parts.append(varying.reshape(kinds, -1).T)
        shading = np.concatenate([rows.shading for rows in varied])
        x = np.concatenate([np.concatenate(parts), shading], axis=-1)
        ends = np.cumsum([len(rows.y) for rows in varied])[:-1]
        weight, factors, left, normal = own, np.zeros(x.shape[1]), y, np.eye(x.shape[1])
        for _ in range(STEPS):
            factors, normal = least_squares(x, y, weight)
            left = y - x @ factors
            weight = own * robust_weights(np.split(left, ends))
        score = x * (weight * left)[:, None]
        sums = np.stack([np.bincount(block, column) for column in score.T], axis=-1)
        inverse = np.linalg.inv(normal)
        strength = factors[:kinds]
        error = np.sqrt(np.diag(inverse @ (sums.T @ sums) @ inverse)[:kinds])
        told = int(np.argmax(strength / np.maximum(error, 1e-30)))
        most = self._most(reflected[0], strength, told) if bounded else np.inf
        if strength[told] > most:
            others = np.delete(x, told, axis=1)
            factors = least_squares(others, y - x[:, told] * most, weight)[0]
            factors = np.insert(factors, told, most)
            strength, left = factors[:kinds], y - x @ factors
        rest = y
        if x.shape[1] > kinds:
            rest = y - x[:, kinds:] @ least_squares(x[:, kinds:], y, weight)[0]
        fit = Fit(
            strength=float(strength[told]),
            error=float(error[told]),
            explained=1.0 - float(weight @ left**2) / max(float(weight @ rest**2), 1e-30),
            blocks=effective_blocks(x, told, weight, block),
            recovered=told == RECOVERED,
        )
        return fit, [part.reshape(-1, 3) for part in np.split(left, ends)]

    def _most(self, reflected: Float, strength: Float, told: int) -> float:
        """Return the largest strength of a kind that the radiance of most cells allows."""
        others = np.maximum(strength, 0.0)
        others[told] = 0.0
        left = (self._color - np.tensordot(others, reflected, 1))[self._kept[0]]
        ratio = left / np.maximum(reflected[told][self._kept[0]], 1e-12)
        return max(float(np.quantile(ratio.min(axis=-1), MAX_BEYOND)), 0.0)

    def _reflection(self, smooth: Sequence[Sequence[Float]], x: Float) -> Reflection:
        fits, costs = [], []
        scales: list[float] = []
        varied = self._varied()
        for part in smooth:
            fit, left = self._fit(varied, part, bounded=True)
            # All roughnesses share one scale, so that their costs are comparable.
            scales = scales or [deviation_of(rest) for rest in left]
            total = np.zeros(self._block.max() + 1)
            for rows, rest, scale in zip(varied, left, scales, strict=True):
                cost = scipy.special.huber(HUBER * scale, rest).sum(axis=-1)
                cost *= self._weight[rows.cells]
                cost *= (scales[0] / scale) ** 2
                total += np.bincount(self._block[rows.cells], cost, len(total))
            costs.append(total)
            fits.append(fit)
        cost = np.array(costs)
        total = cost.sum(axis=1)
        used = cost.any(axis=0)
        without = np.array([lowest(x, total - part) for part in cost.T[used]])
        count = len(without)
        deviation = np.sqrt((count - 1) / count * np.square(without - without.mean()).sum())
        best = int(np.argmax([fit.explained for fit in fits]))
        alpha = SHARPER * float(np.exp(lowest(x, total)))
        return Reflection(alpha, float(np.exp(deviation)), fits[best])
