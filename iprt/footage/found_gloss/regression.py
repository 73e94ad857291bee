"""Robust weighted regression, for `evidence`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from iprt.footage.cells import Float

HUBER = 1.5
"""Residuals, in standard deviations, beyond which cells count linearly."""
MODEL = 0.02
"""Standard deviation of the model error, relative to the local mean radiance."""


def least_squares(x: Float, y: Float, weight: Float) -> tuple[Float, Float]:
    """Solve weighted least squares; return factors, and the matrix of the normal equations."""
    weighted = x * weight[:, None]
    normal = x.T @ weighted
    normal += 1e-9 * max(float(np.trace(normal)), 1e-30) * np.eye(len(normal))
    return np.asarray(np.linalg.solve(normal, weighted.T @ y), np.float64), normal


def deviation_of(left: Float) -> float:
    """Estimate a standard deviation by the median absolute residual; at least `MODEL`."""
    return max(1.4826 * float(np.median(np.abs(left))), MODEL)


def effective_blocks(x: Float, column: int, weight: Float, block: NDArray[np.intp]) -> float:
    """Return (Σ h)² / Σ h², with h the information of a block about the factor of a column.

    It is the variation of the column that the others do not explain. The robust error of a factor
    has about this number of degrees of freedom, plus 1 (Carter, Schnepel and Steigerwald 2017).
    """
    others = np.delete(x, column, axis=1)
    own = x[:, column]
    if others.shape[1]:
        own = own - others @ least_squares(others, own, weight)[0]
    told = np.bincount(block, weight * own**2)
    return float(told.sum() ** 2 / max(np.square(told).sum(), 1e-30))


def robust_weights(left: Sequence[Float]) -> Float:
    """Return the weights of residuals; each frame has its own standard deviation."""
    deviation = [deviation_of(rest) for rest in left]
    return np.concatenate(
        [
            _huber(rest, scale) * (deviation[0] / scale) ** 2
            for rest, scale in zip(left, deviation, strict=True)
        ]
    )


def _huber(left: Float, deviation: float) -> Float:
    bound = HUBER * deviation
    return np.asarray(np.minimum(1.0, bound / np.maximum(np.abs(left), 1e-30)))


def lowest(x: Float, cost: Float) -> float:
    """Return log α at the bottom of a parabola through the lowest cost and its neighbours."""
    best = int(np.clip(np.argmin(cost), 1, len(x) - 2))
    near = slice(best - 1, best + 2)
    bent, slope, _ = np.polyfit(x[near] - x[best], cost[near], 2)
    if not bent > 0.0:
        return float(x[np.argmin(cost)])
    return float(np.clip(x[best] - 0.5 * slope / bent, x[0], x[-1]))
