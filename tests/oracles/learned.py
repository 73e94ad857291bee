"""Online illumination learning (Lee et al. 2022) in float64, by the paper's own equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.frame import LUMINANCE
from iprt.world.real.radiance_models import BANDWIDTH_PENALTY, PRIOR, Learning

Float = NDArray[np.float64]

LEAST_WEIGHT, ALIKE_NORMAL = 0.1, 0.7
FORGETTING_SAMPLES, ERRORS_FROM, LARGEST_STEP = 256.0, 4.0, 0.1


def tangents(normal: Float) -> tuple[Float, Float]:
    """Unit vectors (3,) across a normal: those of `build_frame` (Duff et al. 2017)."""
    x, y, z = normal
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.array([1.0 + sign * x * x * a, sign * b, -sign * x])
    return first, np.array([b, sign + y * y * a, -y])


def weight_of(d: Float, bandwidth: float) -> Float:
    """Eq. 3 for distances (..., 3)."""
    return np.asarray(np.exp(-(d**2).sum(-1) / (2.0 * bandwidth**2)))


@dataclass
class Model:
    """One local linear model; coefficients (3, C) of 1 and both tangents over the radius."""

    centre: Float
    normal: Float
    how: Learning
    bandwidth: float

    def __post_init__(self) -> None:
        self.inverse = np.eye(3) / PRIOR
        self.beta = np.zeros((3, 3))
        self.learned = self.weights = self.errors = 0.0

    def local(self, points: Float) -> Float:
        """(..., 3) rows 1, x, y of points."""
        d = points - self.centre
        along = [d @ t / self.how.radius for t in tangents(self.normal)]
        return np.stack([np.ones(d.shape[:-1]), *along], -1)

    def learn(self, point: Float, normal: Float, color: Float, width: float) -> None:
        """Eqs. 6 and 7, then a step down the gradient of Eq. 8."""
        how, d = self.how, point - self.centre
        w = float(weight_of(d, self.bandwidth))
        if w < LEAST_WEIGHT or normal @ self.normal < ALIKE_NORMAL:
            return
        x = self.local(point)
        forgetting = how.first_forgetting + (how.forgetting - how.first_forgetting) * min(
            self.learned / FORGETTING_SAMPLES, 1.0
        )
        p = self.inverse
        shrunk = np.outer(p @ x, x @ p) / (forgetting / w + x @ p @ x)
        self.inverse = (p - shrunk) / forgetting
        error, before = color - x @ self.beta, self.beta
        self.beta = before + w * np.outer(self.inverse @ x, error)
        if self.learned >= ERRORS_FROM and how.rate > 0.0:
            self._resize(d, w, x, error, before, forgetting, width)
        self.learned += 1.0

    def _resize(
        self, d: Float, w: float, x: Float, error: Float, before: Float, kept: float, width: float
    ) -> None:
        how = self.how
        shown = 1.0 / (how.unit + max(float(LUMINANCE @ before[0]), 0.0)) ** 2 / 3.0
        squared = shown * float(error @ error)
        self.weights = kept * self.weights + w
        self.errors = kept * self.errors + w * squared
        moves = shown * float((self.inverse @ x) @ before @ error)
        b = self.bandwidth / how.metre
        slope = (
            w
            * float(d @ d)
            / self.bandwidth**2
            * (
                squared
                - self.errors / self.weights
                + 2.0 * how.slopes_penalty * self.weights * moves
            )
            - w * 4.0 * BANDWIDTH_PENALTY / b**4
        )
        step = np.clip(-how.rate * slope, -LARGEST_STEP, LARGEST_STEP)
        widest = how.radius / np.sqrt(-2.0 * np.log(LEAST_WEIGHT))
        self.bandwidth = float(np.clip(self.bandwidth * np.exp(step), min(width, widest), widest))


def predicted(models: Float, points: Float, normals: Float, radius: float) -> tuple[Float, Float]:
    """Eq. 4 over all models that have learned enough, without a grid.

    Parameters
    ----------
    models : (M, 5, 4)
        As in `cl/lib/world/real/learned.h`.
    points, normals : (N, 3)

    Returns
    -------
    radiance : (N, 3)
    weight : (N,)
        Sum of the weights; 0: no model is there.
    """
    total, weights = np.zeros(points.shape), np.zeros(len(points))
    for model in models.astype(np.float64):
        centre, normal = model[0, :3], model[1, :3]
        d = points - centre
        w = weight_of(d, model[0, 3])
        w = np.where((w >= LEAST_WEIGHT) & (normals @ normal >= ALIKE_NORMAL), w, 0.0)
        if model[1, 3] < 8.0 or not w.any():
            continue
        x, y = (d @ t / radius for t in tangents(normal))
        value = model[2, :3] + x[:, None] * model[3, :3] + y[:, None] * model[4, :3]
        total += w[:, None] * np.maximum(value, 0.0)
        weights += w
    return total / np.maximum(weights, 1e-30)[:, None], weights
