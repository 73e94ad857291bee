"""Robust estimation of the linear map between the colors of two pictures of the same surfaces.

After section 4 of *Natural Environment Illumination*: weighted least squares, regularised towards a
scale per channel. Here residuals are relative to brightness, and iterated weights exclude surfaces
whose colors changed differently from most.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]

STEPS = 8
"""Number of reweighting steps."""
WIDEST, NARROWING = 0.3, 0.6
"""Relative error at which a pair's weight is a quarter, in the first step; and its factor from each
step to the next. Weights narrow from all pairs to consistent ones (graduated non-convexity)."""
NARROWEST, BEYOND_NOISE = 0.005, 4.0
"""Final value of this error: absolute, or as a multiple of the median error."""
LIKELY_CROSSTALK, LIKELY_TINT, LIKELY_GAIN = 0.1, 0.3, 1.0
"""Prior standard deviations: of a map from a scale per channel, of this scale from a common one,
and of the common scale from 1."""
CLEAR = 4.0
"""Least variance of colors along an axis, in units of noise, that determines crosstalk."""
ALIKE = 16.0
"""Number of pairs with a common error: textures and lights are larger than cells."""
MIN_ERROR = 1e-4
"""Least relative error, which allows for rounding."""
MAJORITY = 0.7
"""Least share of the picture that a map must explain: drift is uniform, light is not."""
EXPLAINED = 0.05
"""Relative error up to which a map explains the color of a pair."""
MAX_GAIN = 8.0
"""Largest gain of a plausible map, and inverse of the least."""
MAX_CONDITION = 16.0
"""Largest condition number: beyond it, different colors become nearly equal, irreversibly."""


class Pairs:
    """Colors of the same surfaces in two pictures.

    Parameters
    ----------
    seen, wanted : (N, 3)
        Linear radiance in the picture that is mapped, and in the other. N > 0.
    weight : (N,)
        Weights; positive.
    region : (N,) int
        Region of the picture that contains each pair.
    dark : float
        Radiance below which colors are uncertain.
    """

    def __init__(
        self,
        seen: Values,
        wanted: Values,
        weight: Values,
        region: NDArray[np.integer],
        dark: float,
    ) -> None:
        self._seen, self._wanted = seen, wanted
        self._region = np.unique(region, return_inverse=True)[1]
        self._share = weight / weight.sum()
        brightness = 1.0 / (wanted.mean(axis=1) + dark)[:, None]
        self._u, self._r = seen * brightness, wanted * brightness

    def fit(self) -> Values | None:
        """Estimate the map (3, 3) from `seen` to `wanted` that holds for most pairs.

        Returns None if it is not plausible (`sane`), or does not explain a majority of them.
        """
        matrix = np.diag(self.scale())
        width = WIDEST
        for _ in range(STEPS):
            error = self._errors(matrix)
            weight = self._share * (width * width / (width * width + error * error)) ** 2
            matrix = _ridge(self._u, self._r, weight, error)
            noise = BEYOND_NOISE * _quantile(error, 0.5, self._share)
            width = max(NARROWING * width, min(max(noise, NARROWEST), EXPLAINED))
        if not sane(matrix) or self._share[self._errors(matrix) < EXPLAINED].sum() < MAJORITY:
            return None
        return matrix

    def left(self, matrix: Values) -> tuple[float, float]:
        """Return the residual of a map, and its standard error.

        The residual is the change between the pictures, relative to brightness, that remains in
        most regions. The mean over a region has little noise, but contains all of a change of
        light. The standard error follows from the variance within regions.
        """
        difference = self._u @ matrix.T - self._r
        share = self._per_region(np.ones(len(difference)))
        mean = np.stack([self._per_region(part) for part in difference.T]) / share
        square = np.stack([self._per_region(part * part) for part in difference.T]) / share
        variance = (square - mean * mean) * self._per_region(self._share) / share**2
        size = np.sqrt((mean * mean).mean(axis=0))
        error = np.sqrt(np.maximum(variance, 0.0).mean(axis=0))
        return _quantile(size, MAJORITY, share), _quantile(error, MAJORITY, share)

    def _per_region(self, values: Values) -> Values:
        """Return weighted sums of (N,) over the regions that have pairs."""
        return np.asarray(np.bincount(self._region, self._share * values))

    def _errors(self, matrix: Values) -> Values:
        difference = self._u @ matrix.T - self._r
        return np.asarray(np.sqrt((difference * difference).mean(axis=1)))

    def scale(self) -> Values:
        """Return median ratios (3,) of `wanted` to `seen` by channel; 1 for a black channel."""
        scale = np.ones(3)
        for channel in range(3):
            seen, wanted = self._seen[:, channel], self._wanted[:, channel]
            lit = (seen > 0.0) & (wanted > 0.0)
            if lit.any():
                scale[channel] = _quantile(wanted[lit] / seen[lit], 0.5, self._share[lit])
        return np.clip(scale, 1.0 / MAX_GAIN, MAX_GAIN)


def sane(matrix: Values) -> bool:
    """Return whether a map is invertible, of moderate gain, and keeps all channels."""
    if not np.isfinite(matrix).all():
        return False
    stretch = np.linalg.svd(matrix, compute_uv=False)
    return bool(
        (np.diag(matrix) > 0.0).all()
        and stretch[0] <= MAX_GAIN
        and stretch[-1] >= 1.0 / MAX_GAIN
        and stretch[0] <= MAX_CONDITION * stretch[-1]
    )


def _quantile(values: Values, share: float, weight: Values) -> float:
    """Return the least value up to which this share of the weight lies."""
    order = np.argsort(values)
    reached = np.cumsum(weight[order])
    place = np.searchsorted(reached, share * reached[-1])
    return float(values[order[min(place, len(order) - 1)]])


def _ridge(u: Values, r: Values, weight: Values, error: Values) -> Values:
    """Fit a map (3, 3) by ridge regression, in three steps.

    The steps are one scale, a scale per channel, and the map. Each is regularised towards the
    previous one.
    """
    weight = weight / weight.sum()
    variance = max(float((weight * error * error).sum()), MIN_ERROR**2)
    # Kish's effective number of pairs.
    likely = variance * min(1.0, ALIKE * float((weight * weight).sum()))
    weighted = u * weight[:, None]
    uu, ur = weighted.T @ u, weighted.T @ r
    pull = likely / LIKELY_GAIN**2
    gain = (np.trace(ur) + pull) / (np.trace(uu) + pull)
    pull = likely / LIKELY_TINT**2
    scale = (np.diag(ur) + pull * gain) / (np.diag(uu) + pull)
    # Half of the error is noise in u, which adds to uu and not to ur. Axes along which colors vary
    # by little more than noise carry no information.
    noise = 0.5 * variance / gain**2
    size, axes = np.linalg.eigh(uu)
    clear = np.maximum(size - CLEAR * noise, 0.0)
    trust = clear / (clear + CLEAR * noise + likely / LIKELY_CROSSTALK**2)
    by_axis = (1.0 - trust) * (scale[:, None] * axes)
    by_axis += trust * (ur.T @ axes) / np.maximum(size - noise, noise)
    return np.asarray(by_axis @ axes.T)
