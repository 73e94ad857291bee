"""Maximum a posteriori estimation of a sky from the shading of a room.

Point i of segment s is diffuse: L_i = ρ_s / π (K_i + Σ_k g_k U_ik), with K_i the irradiance by all
that the panorama shows, and U_ik the extrapolated irradiance from unseen directions about node k.
In logarithms, the reflectance is an offset per segment, so shading within a segment determines the
gains g. The mean of the colors and their differences are compared separately: errors of irradiance
are nearly the same in all colors, so hue is known better than brightness. Differences have robust
weights (Huber) relative to the spread of their segment. Reflectance is at most 0.9: brighter
surfaces prove that light is missing.

How far a sky may differ from its extrapolation is part of the estimate. Of several spreads of the
prior, the one of most evidence is taken (Laplace's approximation of the marginal likelihood,
MacKay, *Information Theory, Inference, and Learning Algorithms*, chapter 27).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from iprt.footage.cells import Float
from iprt.footage.found_sky.prior import precision
from iprt.footage.found_sky.shading import Shading
from iprt.footage.sky import node_directions, upper_weights

SPREADS = (0.1, 0.2, 0.4, 0.8, 1.6)
"""Standard deviations of the mean log-gain that are tried."""
CONTRASTS = np.array([[1.0, 1.0, 1.0], [3.0, -3.0, 0.0], [0.0, -3.0, 3.0]]) / 3.0
"""Mean of the colors, red over green, and blue over green."""
ERRORS = np.array([0.15, 0.03, 0.03])
"""Standard deviations of these contrasts by errors of irradiance."""
ERROR_POINTS = 6.0
"""Weight of `ERRORS` in the spread of a segment, in points."""
ALIKE, MOST = 8.0, 10.0
"""Number of adjacent points with a common error, and most independent points of a segment."""
HUBER = 1.5
"""Number of standard deviations beyond which a residual counts linearly."""
MAX_REFLECTANCE, OVER_SPREAD = 0.9, 0.15
"""Upper bound of reflectances, and spread of their logarithm beyond it."""
STEPS, MAX_STEP, CONVERGED = 30, 0.7, 0.01


@dataclass(frozen=True)
class Estimate:
    """Estimated gains.

    Attributes
    ----------
    gain : (M, 3) float64
    spread : float
        Spread of the prior with the most evidence.
    deviation : (3,) float64
        Standard deviation of the logarithm of the mean gain of the upper hemisphere.
    """

    gain: Float
    spread: float
    deviation: Float


def estimate_gains(shading: Shading) -> Estimate:
    """Estimate the most probable gains of a sky."""
    problem, node = _Problem(shading), node_directions()
    found = [_descent(problem, precision(node, shading.shown, spread)) for spread in SPREADS]
    best = min(range(len(found)), key=lambda index: found[index][1])
    gain, spread = np.exp(found[best][0]).reshape(-1, 3), SPREADS[best]
    information = problem.linearised(found[best][0]).curvature
    information += precision(node, shading.shown, spread)
    share = upper_weights()[:, None] * gain
    slope = share / share.sum(axis=0)
    parts = np.linalg.inv(information).reshape(len(node), 3, len(node), 3)
    deviation = np.sqrt(np.einsum("ic,icjc,jc->c", slope, parts, slope))
    return Estimate(gain, spread, deviation)


def _descent(problem: _Problem, prior: Float) -> tuple[Float, float]:
    """Return the most probable log-gains (3M,), and minus twice their log-evidence."""
    gains = np.zeros(len(prior))
    for _ in range(STEPS):
        here = problem.linearised(gains)
        step = np.linalg.solve(here.curvature + prior, -here.gradient - prior @ gains)
        step *= min(1.0, MAX_STEP / np.abs(step).max())
        gains = gains + step
        if np.abs(step).max() < CONVERGED:
            break
    here = problem.linearised(gains)
    volume = np.linalg.slogdet(here.curvature + prior)[1] - np.linalg.slogdet(prior)[1]
    return gains, float(here.misfit + gains @ prior @ gains + volume)


@dataclass(frozen=True)
class _Local:
    """Twice the negative log-likelihood, with half its gradient and half its curvature."""

    misfit: float
    gradient: Float
    curvature: Float


class _Problem:
    """The misfit between shading and a sky of log-gains (3M,)."""

    def __init__(self, shading: Shading) -> None:
        self._shading = shading
        self._count = np.bincount(shading.segment)[:, None].astype(float)
        points = np.arange(len(shading.segment))
        self._of_segment = scipy.sparse.csr_array((np.ones(len(points)), (shading.segment, points)))
        self._alike = np.maximum(ALIKE, self._count / MOST)

    def linearised(self, gains: Float) -> _Local:
        """Return the misfit at these gains, and how it changes with them."""
        shading, segment = self._shading, self._shading.segment
        lit = shading.unseen * np.exp(gains).reshape(-1, 3)
        received = shading.known + lit.sum(axis=1) + 1e-30
        reflectance = np.log(np.pi * shading.radiance / received)
        contrast = reflectance @ CONTRASTS.T
        weight, spread = self._weights(contrast)
        mean = self._means(weight, contrast)
        apart = contrast - mean[segment]
        robust = 2.0 * scipy.special.huber(HUBER, apart / spread) + 2.0 * np.log(spread)
        misfit = float((robust / self._alike[segment]).sum())
        gradient, curvature = np.zeros(gains.size), np.zeros((gains.size, gains.size))
        share = lit / received[:, None]
        slopes, means = [], []
        for row, own in zip(CONTRASTS, weight.T, strict=True):
            slope = -(share * row).reshape(len(share), -1)
            mean_slope = self._means(own[:, None], slope)
            slopes.append(slope - mean_slope[segment])
            means.append(mean_slope)
        for slope, own, values in zip(slopes, weight.T, apart.T, strict=True):
            weighted = slope.T * own
            gradient += weighted @ values
            curvature += weighted @ slope
        back = np.linalg.inv(CONTRASTS)
        over = np.maximum(mean @ back.T - np.log(MAX_REFLECTANCE), 0.0)
        over_weight = np.maximum(self._count / self._alike, 1.0)[:, 0] / OVER_SPREAD**2
        for row, values in zip(back, over.T, strict=True):
            slope = sum(part * means for part, means in zip(row, means, strict=True))
            weighted = slope.T * over_weight * (values > 0.0)
            gradient += weighted @ values
            curvature += weighted @ slope
            misfit += float((over_weight * values**2).sum())
        return _Local(misfit, gradient, curvature)

    def _weights(self, contrast: Float) -> tuple[Float, Float]:
        """Return robust weights (n, 3) of contrasts, and the spread (n, 3) of their segments.

        They are based on medians, which tolerate up to half of a segment's points as outliers.
        """
        segment = self._shading.segment
        centre = self._medians(contrast)
        square = (1.4826 * self._medians(np.abs(contrast - centre[segment]))) ** 2
        square = (square * self._count + ERRORS**2 * ERROR_POINTS) / (self._count + ERROR_POINTS)
        spread = np.maximum(np.sqrt(square), ERRORS)[segment]
        for _ in range(3):
            apart = np.abs(contrast - centre[segment])
            weight = 1.0 / np.maximum(1.0, apart / (HUBER * spread))
            weight /= self._alike[segment] * spread**2
            centre = self._means(weight, contrast)
        return weight, spread

    def _medians(self, values: Float) -> Float:
        """Return medians (S, 3) of (n, 3) over the points of each segment."""
        numbers, median = np.arange(len(self._count)), scipy.ndimage.median
        return np.stack([median(part, self._shading.segment, numbers) for part in values.T], -1)

    def _means(self, weight: Float, values: Float) -> Float:
        """Return weighted means (S, ...) of (n, ...) over the points of each segment."""
        return np.asarray((self._of_segment @ (weight * values)) / (self._of_segment @ weight))
