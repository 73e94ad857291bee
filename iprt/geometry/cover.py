"""Light that a clearcoat and sheen reflect, for the table of materials.

`cl/lib/world/cover.h` defines both, and lets the rest of the light pass.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from iprt.device.kept import Arrays, kept
from iprt.device.kernel_source import constant, float_constant
from iprt.geometry.coat import Array, fresnel_dielectric, mean_over_normals

_COVER = "lib/world/cover.h"
_NODES = constant(_COVER, "COVER_NODES")
CLEARCOAT_IOR = float_constant(_COVER, "CLEARCOAT_IOR")
"""Index of refraction of clearcoats."""
MIN_SHEEN_ALPHA = float_constant(_COVER, "MIN_SHEEN_ALPHA")
_AZIMUTHS, _COSINES = 256, 256
"""Quadrature nodes for sheen."""


def clearcoat_reflectance(cosine: Array, alpha: float) -> Array:
    """Return the share of light arriving at `cosine` that a clearcoat reflects.

    Parameters
    ----------
    cosine : (N,) float64
        In [0, 1].
    alpha : float
        GGX roughness; 0 for a smooth coat.

    Returns
    -------
    (N,) float64
        Integral over the visible normals of F G2 / G1, with height-correlated masking (Heitz, JCGT
        3(2), 2014, eq. 99).
    """
    if alpha == 0.0:
        return fresnel_dielectric(cosine, CLEARCOAT_IOR)

    def slope(v: Array) -> Array:
        return np.sqrt(v[..., 2] ** 2 + alpha**2 * (1.0 - v[..., 2] ** 2))

    def reflected(o: Array, m: Array, cos_m: Array) -> Array:
        i = 2.0 * cos_m[..., None] * m - o
        unshadowed = i[..., 2] * (o[2] + slope(o)) / (slope(o) * i[..., 2] + slope(i) * o[2])
        return np.where(i[..., 2] > 0.0, fresnel_dielectric(cos_m, CLEARCOAT_IOR) * unshadowed, 0.0)

    return mean_over_normals(cosine, alpha, 128, reflected)


def sheen_reflectance(cosine: Array, alpha: float) -> Array:
    """Return the share of light arriving at `cosine` that white sheen would reflect, unlimited.

    Parameters
    ----------
    cosine : (N,) float64
        In [0, 1].
    alpha : float
        Roughness of the sheen, at least `MIN_SHEEN_ALPHA`.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_COSINES)
    # Squares of the nodes lie close where the sheen is strong, at grazing angles.
    z, weights = ((nodes + 1.0) / 2.0) ** 2, weights * (nodes + 1.0) / 2.0
    azimuth = (np.arange(_AZIMUTHS) + 0.5) * np.pi / _AZIMUTHS
    x = np.sqrt(1.0 - z**2)[:, None] * np.cos(azimuth)
    means = []
    for mu in np.clip(cosine, 1e-6, 1.0):
        # 1 - o h, from the angle between o and i: h = (o + i) / |o + i|.
        along = np.sqrt(1.0 - mu * mu) * x + (mu * z)[:, None]
        sine2 = 1.0 - (mu + z)[:, None] ** 2 / (2.0 + 2.0 * along)
        sine2 = np.clip(sine2, 0.0, 1.0)
        distribution = (2.0 + 1.0 / alpha) * sine2 ** (0.5 / alpha) / (2.0 * np.pi)
        visible = 0.25 / (z + mu - z * mu)
        means.append(2.0 * np.pi * np.sum(weights * z * visible * distribution.mean(axis=1)))
    return np.array(means)


@lru_cache(maxsize=256)
def clearcoat_table(alpha: float) -> NDArray[np.float32]:
    """Return the (8, 4) table of a clearcoat's reflectance."""
    return _table(clearcoat_reflectance, alpha)


@lru_cache(maxsize=256)
def sheen_table(alpha: float) -> NDArray[np.float32]:
    """Return the (8, 4) table of the reflectance of white sheen."""
    return _table(sheen_reflectance, alpha)


def _table(reflectance: Callable[[Array, float], Array], alpha: float) -> NDArray[np.float32]:
    """Return values at squares of equal steps, which are kept: integrals take long.

    They are raised where the reflectance lies above straight lines between them: with less, layers
    would reflect more than arrives.
    """

    def make() -> Arrays:
        values = reflectance(np.linspace(0.0, 1.0, 2 * _NODES - 1) ** 2, alpha)
        nodes, between = values[::2], values[1::2]
        missing = np.pad(np.maximum(between - (nodes[1:] + nodes[:-1]) / 2.0, 0.0), 1)
        raised = nodes + np.maximum(missing[1:], missing[:-1])
        raised = np.minimum(raised, np.maximum(nodes, 1.0))
        return {"values": raised.astype(np.float32).reshape(-1, 4)}

    name = reflectance.__name__
    return np.asarray(kept(name.replace("_", "-"), __name__, [name, alpha], make)["values"])
