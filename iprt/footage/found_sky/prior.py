"""Prior of the gains of a sky: a Gaussian process of their logarithms."""

from __future__ import annotations

import numpy as np

from iprt.footage.cells import Float

REACH = np.deg2rad(60.0)
"""Angle over which the correlation of log-gains drops to 1/e."""
KNOWN = 0.02
"""Variance of log-gains where windows show the sky, relative to that elsewhere."""
TINT_SPREAD = 0.6
"""Standard deviation of each color's log-gain from the mean of the colors."""
NUGGET = 1e-3
"""Relative variance of nodes on their own, for a well-conditioned inverse."""


def precision(node: Float, shown: Float, spread: float) -> Float:
    """Return the inverse covariance (3M, 3M) of log-gains, color by color of each node.

    The correlation between directions falls exponentially with their angle (a Matérn covariance of
    order 1/2): a horizon is sharp. Log-gains are 0 in directions that windows show.

    Parameters
    ----------
    node, shown : (M, 3), (D, 3) float64
        Directions of nodes, and directions that windows show.
    spread : float
        Standard deviation of the mean of the colors.
    """
    own, across = _correlation(node, node), _correlation(node, shown)
    of_shown = _correlation(shown, shown) + KNOWN * np.eye(len(shown))
    left = own - across @ np.linalg.solve(of_shown, across.T) + NUGGET * np.eye(len(node))
    colors = spread**2 * np.ones((3, 3)) + TINT_SPREAD**2 * (np.eye(3) - 1.0 / 3.0)
    return np.kron(np.linalg.inv(left), np.linalg.inv(colors))


def _correlation(a: Float, b: Float) -> Float:
    return np.asarray(np.exp(-np.arccos(np.clip(a @ b.T, -1.0, 1.0)) / REACH))
