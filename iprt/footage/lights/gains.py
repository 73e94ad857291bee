"""Maximum a posteriori estimation of the gains of clipped lights.

After *Online Illumination Learning*, section V-A, which estimates one reflectance and one lost
energy by minimising the difference between observed and re-rendered radiance. Here there are many
reflectances, one per segment of similar surface, and many lights. Point i of segment s is diffuse:

    L_i = ρ_s / π (E_i + Σ_k g_k B_ik)

with E_i the irradiance by unclipped light, and B_ik the irradiance by light k as stored. In
logarithms, the reflectance is an offset per segment, so shading within a segment determines the
gains g. Textures and highlights corrupt some differences of log-radiance, which therefore have
robust weights (Huber) relative to the spread of their segment. Reflectance is at most 0.9: brighter
surfaces prove that light is missing (energy balance). This counts as strongly as shading, because
tone mapping flattens shading but not the energy balance.

Where neither constrains the gains, priors do, far weaker than a well-lit wall. Gains are small, and
similar between the colors of a light and between adjacent parts of it; reflectances are typical of
rooms. A clipped surface that may be reflecting its irradiance is expected to do so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Float = NDArray[np.float64]

MAX_GAIN = 1e4
"""Upper bound of gains: a sun in a picture exposed for the landscape."""
EXPECTED_GAIN, GAIN_SPREAD = 3.0, 2.5
"""Median of gains, and standard deviation of their logarithm (as for all spreads below)."""
COLOR_SPREAD, HALF_CLIPPED_SPREAD = 1.5, 0.4
"""Spread between the gains of two colors of a light: both clipped, or one, which lost little."""
LOCUS_SLOPE, TINT_SPREAD = 0.1, 0.1
"""Chromaticity prior: slope of green over the mean of red and blue, against red over blue, and its
spread. Lights are warm or cold, like black bodies (2700 K to 10000 K) and skies."""
EXPECTED_REFLECTANCE, REFLECTANCE_SPREAD = 0.4, 1.0
MAX_REFLECTANCE = 0.9
CLIPPED_REFLECTANCE, CLIPPED_SPREAD = 0.6, 0.2
"""Reflectance of clipped surfaces that only reflect, and its spread; they are bright."""
HUBER = 1.5
"""Number of standard deviations beyond which a residual counts linearly."""
MODEL_SPREAD, MODEL_POINTS = 0.15, 6.0
"""Error of the re-rendering, and its weight in points of a segment's spread."""
ALIKE = 4.0
"""Number of adjacent points with a common error."""
STEPS, CONVERGED = 60, 1e-3
STARTS = (2.0, 30.0)
"""Initial gains of the search. A small lamp has no influence on walls unless it is bright."""


@dataclass(frozen=True)
class Shading:
    """Observed radiance at n points in S segments, and irradiance by K lights.

    Attributes
    ----------
    radiance : (n, 3) float64
        Observed radiance; positive.
    segment : (n,) int
        Segment of each point, from 0 to S - 1; none is empty.
    rest : (n, 3) float64
        Irradiance by unclipped light.
    lights : (n, 3, K) float64
        Irradiance by each light, as stored.
    shine : (m, 3) float64
        Observed (clipped) radiance of m points of clipped surfaces.
    shining : (m,) int
        Index of the light that each of them belongs to.
    shine_rest, shine_lights : (m, 3), (m, 3, K) float64
        Irradiance of these points, by unclipped light and by each light.
    """

    radiance: Float
    segment: NDArray[np.intp]
    rest: Float
    lights: Float
    shine: Float
    shining: NDArray[np.intp]
    shine_rest: Float
    shine_lights: Float


Tie = tuple[int, int, float]
"""A prior that two lights have similar gains, and the expected spread of their logarithms."""


@dataclass(frozen=True)
class ClipGains:
    """Estimated gains of clipped lights.

    Attributes
    ----------
    gain : (K, 3) float64
        True radiance over the clipped one, at least 1.
    reflectance : (S, 3) float64
        Reflectance of the segments.
    cost : float
        Twice the negative log-likelihood, for comparison of fits to the same points.
    """

    gain: Float
    reflectance: Float
    cost: float


def clip_gains(shading: Shading, ties: Sequence[Tie], clipped: NDArray[np.bool_]) -> ClipGains:
    """Estimate the most probable gains, by Gauss-Newton steps on their logarithms.

    Parameters
    ----------
    shading : Shading
        With at least one point.
    ties : sequence of Tie
        Pairs of lights with similar gains.
    clipped : (K, 3) bool
        Clipped channels of each light; the gains of others are 1.
    """
    problem = _Problem(shading, ties, clipped)
    ends = [_descent(problem, np.where(clipped, np.log(g), 0.0).ravel()) for g in STARTS]
    gains = min(ends, key=problem.neg_log_likelihood)
    cost = problem.neg_log_likelihood(gains)  # with the weights of these gains
    return ClipGains(np.exp(gains).reshape(-1, 3), np.exp(problem.reflectance(gains)), cost)


def _descent(problem: _Problem, gains: Float) -> Float:
    """Descend to a local optimum of the log-gains (3K,); entries that are 0 stay."""
    clipped, damping = gains > 0.0, 1e-3
    for _ in range(STEPS):
        problem.reweight(gains)
        cost, gradient, curvature = problem.linearised(gains)
        # A gain of 1 that would decrease is fixed (active bound).
        free = ~((gains <= 0.0) & (gradient > 0.0)) & clipped
        if not free.any():
            break
        here = np.ix_(free, free)
        moved = gains
        for _ in range(8):
            damped = curvature[here] + damping * np.diag(np.diag(curvature[here]))
            step = np.zeros_like(gains)
            step[free] = np.clip(np.linalg.solve(damped, -gradient[free]), -1.0, 1.0)
            trial = np.clip(gains + step, 0.0, np.log(MAX_GAIN))
            if problem.cost(trial) <= cost:
                moved, damping = trial, max(damping / 3.0, 1e-6)
                break
            damping *= 4.0
        change = float(np.abs(moved - gains).max())
        gains = moved
        if change < CONVERGED:
            break
    return gains


class _Problem:
    """Fixed priors, and robust weights that change; gains are (3K,) logarithms."""

    def __init__(self, shading: Shading, ties: Sequence[Tie], clipped: NDArray[np.bool_]) -> None:
        self._shading = shading
        count = np.bincount(shading.segment).astype(float)
        self._count = count[:, None]
        points = np.arange(len(shading.segment))
        self._of_segment = scipy.sparse.csr_array((np.ones(len(points)), (shading.segment, points)))
        self._prior_weight = np.minimum(count / count.mean(), 2.0)[:, None] / 3.0
        # ALIKE points of a segment count as one, as they do in shading.
        self._over_weight = np.maximum(count, ALIKE)[:, None] / (ALIKE * MODEL_SPREAD**2)
        self._rows, self._values = _expectations(ties, clipped)
        self._weight = np.ones_like(shading.radiance)
        self._spread = np.full((len(count), 3), 0.3)
        per_light = np.maximum(np.bincount(shading.shining, minlength=len(clipped)), 1.0)
        self._share = 1.0 / per_light[shading.shining, None]
        self._shine_weight = np.zeros_like(shading.shine)

    def reflectance(self, gains: Float) -> Float:
        """Return log-reflectances (S, 3) of the segments."""
        return self._means(self._point_reflectance(gains))

    def reweight(self, gains: Float) -> None:
        """Update the weights from the residuals at these gains.

        They are based on medians, which tolerate up to half of a segment's points as outliers.
        """
        found, segment = self._point_reflectance(gains), self._shading.segment
        centre = self._medians(found)
        square = (1.4826 * self._medians(np.abs(found - centre[segment]))) ** 2 * self._count
        square += MODEL_SPREAD**2 * MODEL_POINTS
        self._spread = np.sqrt(square / (self._count + MODEL_POINTS))
        spread = self._spread[segment]
        for _ in range(3):
            apart = np.abs(found - centre[segment])
            self._weight = 1.0 / np.maximum(1.0, apart / (HUBER * spread)) / (ALIKE * spread**2)
            centre = self._means(found)
        # Lamps emit light: the larger a surface's surplus, the less its reflection counts.
        surplus = self._surplus(gains)
        self._shine_weight = self._share / (CLIPPED_SPREAD * (1.0 + surplus**2)) ** 2

    def cost(self, gains: Float) -> float:
        """Return the weighted sum of squares; half of it has the gradient of `linearised`."""
        squares = (weight * values**2 for values, weight in self._terms(gains))
        apart = self._rows @ gains - self._values
        return float(sum(part.sum() for part in squares) + apart @ apart)

    def neg_log_likelihood(self, gains: Float) -> float:
        """Return twice the negative log-likelihood, up to a constant."""
        self.reweight(gains)
        points, surplus, *prior = self._terms(gains)
        spread = self._spread[self._shading.segment]
        robust = 2.0 * scipy.special.huber(HUBER, points[0] / spread)
        square = surplus[0] ** 2
        apart = self._rows @ gains - self._values
        total = ((robust + 2.0 * np.log(spread)) / ALIKE).sum() + apart @ apart
        total += sum((weight * values**2).sum() for values, weight in prior)
        return float(total + (self._share * square / (1.0 + square)).sum() / CLIPPED_SPREAD**2)

    def linearised(self, gains: Float) -> tuple[float, Float, Float]:
        """Return cost, gradient (3K,) and Gauss-Newton curvature (3K, 3K), for fixed weights."""
        curvature = self._rows.T @ self._rows
        gradient = self._rows.T @ (self._rows @ gains - self._values)
        terms = zip(self._terms(gains), self._derivatives(gains), strict=True)
        for (values, weight), derivative in terms:
            for c in range(3):  # a channel depends on the gains of this channel alone
                own, slope = np.arange(c, gains.size, 3), derivative[:, c]
                weighted = (slope * weight[:, c, None]).T
                curvature[np.ix_(own, own)] += weighted @ slope
                gradient[own] += weighted @ values[:, c]
        return self.cost(gains), gradient, curvature

    def _terms(self, gains: Float) -> list[tuple[Float, Float]]:
        """Return residuals (..., 3) and weights, of points, clipped surfaces and reflectances."""
        found = self._point_reflectance(gains)
        mean = self._means(found)
        over = np.maximum(mean - np.log(MAX_REFLECTANCE), 0.0)
        weight = np.repeat(self._prior_weight, 3, axis=1)
        return [
            (found - mean[self._shading.segment], self._weight),
            (self._surplus(gains), self._shine_weight),
            (mean - np.log(EXPECTED_REFLECTANCE), weight / REFLECTANCE_SPREAD**2),
            (over, np.repeat(self._over_weight, 3, axis=1)),
        ]

    def _derivatives(self, gains: Float) -> list[Float]:
        """Return the derivatives (..., 3, K) of `_terms` by the gains of the same channel."""
        shading = self._shading
        found = -_shares(shading.rest, shading.lights, gains)
        mean = self._means(found)
        own = np.eye(found.shape[2])[shading.shining][:, None]
        over = self.reflectance(gains) > np.log(MAX_REFLECTANCE)
        return [
            found - mean[shading.segment],
            own - _shares(shading.shine_rest, shading.shine_lights, gains),
            mean,
            mean * over[..., None],
        ]

    def _point_reflectance(self, gains: Float) -> Float:
        """Return the log-reflectance (n, 3) of each point on its own."""
        received = _received(self._shading.rest, self._shading.lights, gains)
        return np.asarray(np.log(self._shading.radiance * np.pi / received))

    def _surplus(self, gains: Float) -> Float:
        """Return the log-ratio (m, 3) of radiosity to expected reflection of clipped surfaces."""
        shading = self._shading
        received = _received(shading.shine_rest, shading.shine_lights, gains)
        sent = shading.shine * np.exp(gains).reshape(-1, 3)[shading.shining]
        return np.asarray(np.log(sent * np.pi / (CLIPPED_REFLECTANCE * received)))

    def _medians(self, values: Float) -> Float:
        """Return medians (S, 3) of (n, 3) over the points of each segment."""
        numbers = np.arange(len(self._spread))
        segment, median = self._shading.segment, scipy.ndimage.median
        return np.stack([median(part, segment, numbers) for part in values.T], -1)

    def _means(self, values: Float) -> Float:
        """Return weighted means (S, 3, ...) of (n, 3, ...) over the points of each segment."""
        weight = self._weight.reshape(-1, 3, *[1] * (values.ndim - 2))
        sums, total = (
            (self._of_segment @ part.reshape(len(part), -1)).reshape(-1, *part.shape[1:])
            for part in (weight * values, weight)
        )
        return np.asarray(sums / np.maximum(total, 1e-12))


def _received(rest: Float, lights: Float, gains: Float) -> Float:
    """Return irradiance (n, 3) with all lights."""
    linear = np.exp(gains).reshape(-1, 3)
    return np.asarray(rest + np.einsum("nck,kc->nc", lights, linear) + 1e-30)


def _shares(rest: Float, lights: Float, gains: Float) -> Float:
    """Return each light's share (n, 3, K) of irradiance: the derivative of its logarithm."""
    lit = lights * np.exp(gains).reshape(-1, 3).T
    return np.asarray(lit / _received(rest, lights, gains)[..., None])


def _expectations(ties: Sequence[Tie], clipped: NDArray[np.bool_]) -> tuple[Float, Float]:
    """Return rows and values of linear equations that the log-gains (3K,) meet a priori."""
    rows, values = [], []

    def expect(terms: dict[int, float], value: float, spread: float) -> None:
        row = np.zeros(clipped.size)
        row[list(terms)] = list(terms.values())
        rows.append(row / spread)
        values.append(value / spread)

    for light in range(len(clipped)):
        for c in range(3):
            expect({3 * light + c: 1.0}, float(np.log(EXPECTED_GAIN)), GAIN_SPREAD)
            other = (c + 1) % 3
            both = clipped[light, c] == clipped[light, other]
            spread = COLOR_SPREAD if both else HALF_CLIPPED_SPREAD
            expect({3 * light + c: 1.0, 3 * light + other: -1.0}, 0.0, spread)
        if clipped[light].all():
            red, blue = -0.5 - LOCUS_SLOPE, -0.5 + LOCUS_SLOPE
            expect({3 * light: red, 3 * light + 1: 1.0, 3 * light + 2: blue}, 0.0, TINT_SPREAD)
    for first, second, spread in ties:
        for c in range(3):
            if clipped[first, c] and clipped[second, c]:
                expect({3 * first + c: 1.0, 3 * second + c: -1.0}, 0.0, spread)
    return np.array(rows), np.array(values)
