"""How much brighter clipped lights are than they look: reflectance and lost energy.

After *Online Illumination Learning*, section V-A, which finds one reflectance and one lost energy
by minimising the difference between observed and re-rendered radiance. Here there are many
reflectances, one per segment of like surface, and many lights. A diffuse point i of segment s has

    L_i = ρ_s / π (E_i + Σ_k g_k B_ik)

with E_i the irradiance by all that is not clipped, and B_ik that of light k as it looks. In
logarithms the reflectance is an offset per segment, so that shading within a segment tells the
gains g; the differences of log-radiance, which textures and highlights spoil in places, are
weighted robustly (Huber), by the spread of their segment.

Where shading does not tell, expectations do, far weaker than a well-lit wall: gains are a few, and
alike in the colours of a light and in parts of it that touch; reflectances are those of rooms, and
at most 0.9: a surface that shines more than that shows that light is missing (energy balance). A
clipped surface that may well reflect what it receives is expected to do so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

MAX_GAIN = 1e4
"""A sun in a picture that shows the landscape."""
EXPECTED_GAIN, GAIN_SPREAD = 3.0, 2.5
"""Median, and standard deviation of its logarithm (so are all that follow)."""
COLOR_SPREAD, HALF_CLIPPED_SPREAD = 1.5, 0.4
"""Gains of two colours of one light differ so: both clipped, or one, which is little more then."""
TINT_SPREAD = 0.2
"""Green differs so from red and blue: lights are warm or cold, as glowing bodies and skies are."""
EXPECTED_REFLECTANCE, REFLECTANCE_SPREAD = 0.4, 1.0
MOST_REFLECTANCE, OVER_SPREAD = 0.9, 0.1
CLIPPED_REFLECTANCE, CLIPPED_SPREAD = 0.6, 0.2
"""Clipped surfaces that reflect are bright ones."""
HUBER = 1.5
"""Standard deviations beyond which a residual counts linearly."""
MODEL_SPREAD, MODEL_POINTS = 0.15, 6.0
"""Error of the re-rendering itself, which counts as so many points of a segment's spread."""
ALIKE = 4.0
"""Points whose errors are one error: they lie side by side."""
STEPS, CONVERGED = 60, 1e-3
STARTS = (2.0, 30.0)
"""Gains from which the search starts: a small lamp shows no influence on walls unless it is bright.
"""


@dataclass(frozen=True)
class Shading:
    """What is observed at n points in S segments, and what K lights do to them.

    Attributes
    ----------
    radiance : (n, 3) float64
        Observed; positive.
    segment : (n,) int
        From 0 to S - 1, each with points.
    rest : (n, 3) float64
        Irradiance by what is not clipped.
    lights : (n, 3, K) float64
        Irradiance by each light as it looks.
    shine : (m, 3) float64
        Observed (clipped) radiance of m points of clipped surfaces.
    shining : (m,) int
        Which light each of them is.
    shine_rest, shine_lights : (m, 3), (m, 3, K) float64
        What they receive.
    """

    radiance: Float
    segment: NDArray[np.intp]
    rest: Float
    lights: Float
    shine: Float
    shining: NDArray[np.intp]
    shine_rest: Float
    shine_lights: Float


@dataclass(frozen=True)
class Tie:
    """Lights `first` and `second` are expected to have like gains, within `spread`."""

    first: int
    second: int
    spread: float


@dataclass(frozen=True)
class ClipGains:
    """Attributes
    ----------
    gain : (K, 3) float64
        True radiance over the clipped one, at least 1.
    reflectance : (S, 3) float64
        Reflectance of the segments.
    """

    gain: Float
    reflectance: Float


def clip_gains(shading: Shading, ties: Sequence[Tie], clipped: NDArray[np.bool_]) -> ClipGains:
    """The most probable gains, by Gauss-Newton steps on their logarithms.

    Parameters
    ----------
    shading : Shading
        With at least one point.
    ties : sequence of Tie
    clipped : (K, 3) bool
        Which channels of a light are clipped; the gains of others are 1.
    """
    problem = _Problem(shading, ties, clipped)
    ends = [_descent(problem, np.where(clipped, np.log(g), 0.0).ravel()) for g in STARTS]
    gains = min(ends, key=problem.neg_log_likelihood)
    problem.reweight(gains)
    return ClipGains(np.exp(gains).reshape(-1, 3), np.exp(problem.reflectance(gains)))


def _descent(problem: _Problem, gains: Float) -> Float:
    """Log-gains (3K,) of the optimum that lies downhill; those that are 0 stay."""
    clipped, damping = gains > 0.0, 1e-3
    for _ in range(STEPS):
        problem.reweight(gains)
        cost, gradient, curvature = problem.linearised(gains)
        # A gain of 1 that would be lower stays where it is.
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
    """Expectations that do not change, and robust weights that do; gains are (3K,) logarithms."""

    def __init__(self, shading: Shading, ties: Sequence[Tie], clipped: NDArray[np.bool_]) -> None:
        self.shading = shading
        self.lights = shading.lights.shape[2]
        self.segments = int(shading.segment.max()) + 1
        self.count = np.bincount(shading.segment, minlength=self.segments).astype(float)
        self.prior_weight = np.minimum(self.count / self.count.mean(), 2.0)[:, None] / 3.0
        self.rows, self.values = _expectations(self.lights, ties, clipped)
        self.observed = np.log(shading.radiance * np.pi)
        self.weight = np.ones_like(self.observed)
        self.spread = np.full((self.segments, 3), 0.3)
        self.reflects = self.share = np.zeros_like(shading.shine)

    def residual(self, gains: Float) -> Float:
        """(n, 3): log-reflectance of each point by itself."""
        return np.asarray(self.observed - np.log(self._received(gains)))

    def _received(self, gains: Float) -> Float:
        linear = np.exp(gains).reshape(-1, 3)
        return np.asarray(
            self.shading.rest + np.einsum("nck,kc->nc", self.shading.lights, linear) + 1e-30
        )

    def of_segments(self, values: Float) -> Float:
        """(S, 3): weighted means over the points of each segment."""
        segment, weight = self.shading.segment, self.weight
        columns = [
            np.bincount(segment, weight[:, c] * values[:, c], self.segments)
            / np.maximum(np.bincount(segment, weight[:, c], self.segments), 1e-12)
            for c in range(3)
        ]
        return np.stack(columns, axis=1)

    def reflectance(self, gains: Float) -> Float:
        """(S, 3) logarithms."""
        return self.of_segments(self.residual(gains))

    def reweight(self, gains: Float) -> None:
        """Make the weights for the residuals at these gains."""
        residual, segment = self.residual(gains), self.shading.segment
        for _ in range(3):
            apart = np.abs(residual - self.of_segments(residual)[segment])
            spread = self.spread[segment]
            self.weight = 1.0 / np.maximum(1.0, apart / (HUBER * spread)) / (ALIKE * spread**2)
        for s in range(self.segments):
            deviation = 1.4826 * np.median(apart[segment == s], axis=0)
            points = self.count[s]
            self.spread[s] = np.sqrt(
                (deviation**2 * points + MODEL_SPREAD**2 * MODEL_POINTS) / (points + MODEL_POINTS)
            )
        # Lamps shine by themselves: the more a surface must, the less its reflection says.
        shine, _ = self._shine(gains)
        per_light = np.bincount(self.shading.shining, minlength=self.lights)
        share = 1.0 / np.maximum(per_light, 1.0)[self.shading.shining, None]
        self.reflects = share / (CLIPPED_SPREAD * (1.0 + shine**2)) ** 2
        self.share = share

    def _shine(self, gains: Float) -> tuple[Float, Float]:
        """(m, 3) logarithm of what clipped surfaces send over what they are expected to reflect,
        and (m, 3, K) its derivative by each light's gain."""
        shading = self.shading
        linear = np.exp(gains).reshape(-1, 3)
        lit = shading.shine_lights * linear.T
        received = shading.shine_rest + lit.sum(-1) + 1e-30
        sent = shading.shine * linear[shading.shining]
        derivative = -lit / received[..., None]
        derivative[np.arange(len(sent)), :, shading.shining] += 1.0
        return np.log(sent * np.pi / (CLIPPED_REFLECTANCE * received)), derivative

    def cost(self, gains: Float) -> float:
        """Half of it has `gradient` and about `curvature` of `linearised`."""
        residual = self.residual(gains)
        reflectance = self.of_segments(residual)
        apart = residual - reflectance[self.shading.segment]
        total = (self.weight * apart**2).sum()
        total += ((self.rows @ gains - self.values) ** 2).sum()
        total += (self.prior_weight * self._neg_log_prior(reflectance)[0]).sum()
        return float(total + (self.reflects * self._shine(gains)[0] ** 2).sum())

    def neg_log_likelihood(self, gains: Float) -> float:
        """Twice the negative log-likelihood, but for a constant, to tell which optimum is best."""
        self.reweight(gains)
        residual = self.residual(gains)
        reflectance = self.of_segments(residual)
        spread = self.spread[self.shading.segment]
        apart = np.abs(residual - reflectance[self.shading.segment]) / spread
        huber = np.where(apart < HUBER, apart**2, 2.0 * HUBER * apart - HUBER**2)
        shine = self._shine(gains)[0] ** 2
        total = ((huber + 2.0 * np.log(spread)) / ALIKE).sum()
        total += ((self.rows @ gains - self.values) ** 2).sum()
        total += (self.prior_weight * self._neg_log_prior(reflectance)[0]).sum()
        return float(total + (self.share * shine / (1.0 + shine)).sum() / CLIPPED_SPREAD**2)

    @staticmethod
    def _neg_log_prior(reflectance: Float) -> tuple[Float, Float, Float]:
        """How unlikely log-reflectances are, and half of its first and second derivative."""
        apart = reflectance - np.log(EXPECTED_REFLECTANCE)
        over = np.maximum(reflectance - np.log(MOST_REFLECTANCE), 0.0)
        a, b = 1.0 / REFLECTANCE_SPREAD**2, 1.0 / OVER_SPREAD**2
        return a * apart**2 + b * over**2, a * apart + b * over, a + b * (over > 0.0)

    def linearised(self, gains: Float) -> tuple[float, Float, Float]:
        """Cost, gradient (3K,) and Gauss-Newton curvature (3K, 3K), weights held."""
        shading, segment = self.shading, self.shading.segment
        curvature = self.rows.T @ self.rows
        gradient = self.rows.T @ (self.rows @ gains - self.values)
        residual = self.residual(gains)
        reflectance = self.of_segments(residual)
        _, slope, bend = self._neg_log_prior(reflectance)
        linear, received = np.exp(gains).reshape(-1, 3), self._received(gains)
        shine, shine_derivative = self._shine(gains)
        for c in range(3):
            own = np.arange(self.lights) * 3 + c
            derivative = -shading.lights[:, c] * linear[:, c] / received[:, c, None]
            weight = self.weight[:, c]
            total = np.maximum(np.bincount(segment, weight, self.segments), 1e-12)
            mean = np.stack(
                [
                    np.bincount(segment, weight * derivative[:, k], self.segments) / total
                    for k in range(self.lights)
                ],
                axis=1,
            )
            derivative = derivative - mean[segment]
            parts = (
                (derivative, weight, residual[:, c] - reflectance[segment, c]),
                (shine_derivative[:, c], self.reflects[:, c], shine[:, c]),
            )
            for slopes, weights, values in parts:
                curvature[np.ix_(own, own)] += (slopes * weights[:, None]).T @ slopes
                gradient[own] += (slopes * weights[:, None]).T @ values
            prior_weight = self.prior_weight[:, 0]
            curvature[np.ix_(own, own)] += (mean * (prior_weight * bend[:, c])[:, None]).T @ mean
            gradient[own] += mean.T @ (prior_weight * slope[:, c])
        return self.cost(gains), gradient, curvature


def _expectations(
    lights: int, ties: Sequence[Tie], clipped: NDArray[np.bool_]
) -> tuple[Float, Float]:
    """Rows and values of linear equations that log-gains (3K,) are expected to meet."""
    rows, values = [], []

    def expect(terms: dict[int, float], value: float, spread: float) -> None:
        row = np.zeros(3 * lights)
        for index, factor in terms.items():
            row[index] = factor
        rows.append(row / spread)
        values.append(value / spread)

    for light in range(lights):
        for c in range(3):
            expect({3 * light + c: 1.0}, float(np.log(EXPECTED_GAIN)), GAIN_SPREAD)
            other = (c + 1) % 3
            both = clipped[light, c] == clipped[light, other]
            spread = COLOR_SPREAD if both else HALF_CLIPPED_SPREAD
            expect({3 * light + c: 1.0, 3 * light + other: -1.0}, 0.0, spread)
        if clipped[light].all():
            expect({3 * light: -0.5, 3 * light + 1: 1.0, 3 * light + 2: -0.5}, 0.0, TINT_SPREAD)
    for tie in ties:
        for c in range(3):
            if clipped[tie.first, c] and clipped[tie.second, c]:
                expect({3 * tie.first + c: 1.0, 3 * tie.second + c: -1.0}, 0.0, tie.spread)
    return np.array(rows), np.array(values)
