"""Transmittance of a rough dielectric coat, averaged over its visible normals.

Mitsuba 3's `roughplastic` scales its diffuse base with these averages, and this module follows it.
The values for a smooth coat differ: at alpha = 0.1, ior = 1.5 they make the base 11% brighter at
normal incidence and 30% darker at a cosine of 0.1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_OUTSIDE_NODES = 64
"""Quadrature nodes per axis for light from outside, where the integrand is smooth."""
_INSIDE_NODES = 128
"""Quadrature nodes per axis for light from inside; total reflection puts a kink in the
integrand."""


def fresnel_dielectric(cosine: Array, eta: float) -> Array:
    """Return the unpolarized Fresnel reflectance of a smooth boundary.

    Parameters
    ----------
    cosine : (...) float64
        Cosine of the angle of incidence, in [0, 1].
    eta : float
        Index of refraction beyond the boundary over the index before it.
    """
    c = np.maximum(cosine, 1e-12)
    g = np.sqrt(np.maximum(eta**2 - 1 + c**2, 0))
    s = (c - g) / (c + g)
    p = (eta**2 * c - g) / (eta**2 * c + g)
    return np.asarray(0.5 * (s**2 + p**2))


def rough_transmittance(cosine: Array, alpha: float, ior: float) -> Array:
    """Return the fraction of light arriving from outside at `cosine` that crosses the coat.

    Parameters
    ----------
    cosine : (N,) float64
        In [0, 1].
    alpha : float
        GGX roughness; 0 for a smooth coat.
    ior : float
        Index of refraction of the coat; outside is 1.

    Returns
    -------
    (N,) float64
        Integral over the visible normals of (1 - F) G1(refracted direction): Walter et al.,
        "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007, with separable G.
    """
    if alpha == 0:
        return 1 - fresnel_dielectric(cosine, ior)

    def transmitted(o: Array, m: Array, cos_m: Array) -> Array:
        cos_t = np.sqrt(np.maximum(1 - (1 - cos_m**2) / ior**2, 0))
        z = m[..., 2] * (cos_m / ior - cos_t) - o[..., 2] / ior
        return np.where(z < 0, (1 - fresnel_dielectric(cos_m, ior)) * _masking(z, alpha), 0)

    return mean_over_normals(cosine, alpha, _OUTSIDE_NODES, transmitted)


def internal_reflectance(alpha: float, ior: float) -> float:
    """Return the fraction of diffuse light from the base that the coat reflects back down.

    For a rough coat this is the mean over 64 equidistant cosines, as in Mitsuba 3. The integral is
    1.5% higher at alpha = 0.1 and would make the base 2% brighter than the reference.
    """
    if alpha == 0:
        # By reciprocity, the leaving light is the entering light over ior², over the hemisphere.
        nodes, weights = _unit_quadrature(256)
        entering = np.sum(2 * nodes * weights * (1 - fresnel_dielectric(nodes, ior)))
        return float(1 - entering / ior**2)

    def reflected(o: Array, m: Array, cos_m: Array) -> Array:
        z = 2 * cos_m * m[..., 2] - o[..., 2]
        return np.where(z > 0, fresnel_dielectric(cos_m, 1 / ior) * _masking(z, alpha), 0)

    cosine = np.linspace(0, 1, 64)
    return float(2 * np.mean(cosine * mean_over_normals(cosine, alpha, _INSIDE_NODES, reflected)))


def _unit_quadrature(count: int) -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def _masking(z: Array, alpha: float) -> Array:
    """Return Smith's G1 of GGX for unit directions with cosine `z`."""
    tan2 = (1 - z**2) / np.maximum(z**2, 1e-24)
    return 2 / (1 + np.sqrt(1 + alpha**2 * np.maximum(tan2, 0)))


def mean_over_normals(
    cosine: Array, alpha: float, count: int, function: Callable[[Array, Array, Array], Array]
) -> Array:
    """Average function(o, m, o·m) over the GGX normals m visible from o, for each cosine of o.

    The azimuth of o does not matter, and the integrand is even in the azimuth of the normals.
    """
    nodes, weights = _unit_quadrature(count)
    v, u = (axis.ravel() for axis in np.meshgrid(1 - nodes, nodes / 2, indexing="ij"))
    means = np.empty(len(cosine))
    for i, mu in enumerate(np.clip(cosine, 1e-6, 1)):
        o = np.array([np.sqrt(1 - mu**2), 0, mu])
        m = visible_normals(o[None], alpha, u, v).reshape(count, count, 3)
        means[i] = weights @ function(o, m, m @ o) @ weights
    return means


def visible_normals(out: Array, alpha: float, u: Array, v: Array) -> Array:
    """Return the GGX normals that are visible from directions, for numbers u and v in [0, 1).

    They are sampled by spherical caps (Dupuy and Benyoub, "Sampling Visible GGX Normals with
    Spherical Caps", HPG 2023).

    Parameters
    ----------
    out : (n, 3) float64
        Unit directions in the frame of the surface, whose normal is +z.
    alpha : float
        GGX roughness.
    u, v : (n,) float64
        Azimuth of the cap's point, in turns, and its height from the top.

    Returns
    -------
    (n, 3) float64
        Unit normals.
    """
    stretch = np.array([alpha, alpha, 1.0])
    seen = out * stretch
    seen /= np.linalg.norm(seen, axis=-1, keepdims=True)
    height = (1.0 - v) * (1.0 + seen[:, 2]) - seen[:, 2]
    radius = np.sqrt(np.clip(1.0 - height * height, 0.0, 1.0))
    azimuth = 2.0 * np.pi * u
    cap = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=-1)
    facet = (cap + seen) * stretch
    return np.asarray(facet / np.linalg.norm(facet, axis=-1, keepdims=True))
