"""Chi-square tests of directions against their stated density."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

Float = NDArray[np.float64]
Density = Callable[[NDArray[np.float32]], NDArray[np.floating]]
"""1/sr at directions (N, 3)."""


def basis(axis: Float) -> Float:
    """(3, 3) rows x, y, z: right-handed, z the unit vector `axis`."""
    x = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis])


def even_directions(count: int, seed: int = 0) -> NDArray[np.float32]:
    """(count, 3) over the sphere."""
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True), np.float32)


def _edges(values: Float, parts: int) -> Float:
    """(parts + 1,) between equal numbers of the values, outliers left out."""
    edges = np.quantile(values, np.linspace(0.005, 0.995, parts + 1))
    return np.asarray(edges)


class Bins:
    """Parts of the sphere around `pilot` directions (N, 3), fine where these are dense: rings about
    their mean, each cut by azimuth.
    """

    def __init__(self, pilot: NDArray[np.floating], side: int) -> None:
        axis = pilot.mean(0, dtype=np.float64)
        self._basis = basis(axis / np.linalg.norm(axis))
        self._side = side
        z, phi = self._coordinates(pilot)
        self._z = _edges(z, side)
        ring = np.searchsorted(self._z, z) - 1
        self._phi = np.array([_edges(phi[ring == i], side) for i in range(side)])

    def _coordinates(self, d: NDArray[np.floating]) -> tuple[Float, Float]:
        x, y, z = (d.astype(np.float64) @ self._basis.T).T
        return z / np.sqrt(x * x + y * y + z * z), np.arctan2(y, x)

    def counts(self, d: NDArray[np.floating]) -> Float:
        """(side²,) directions (N, 3) in each."""
        z, phi = self._coordinates(d)
        ring = np.searchsorted(self._z, z) - 1
        found = (ring >= 0) & (ring < self._side)
        ring, phi = ring[found], phi[found]
        column = (self._phi[ring] < phi[:, None]).sum(1) - 1
        found = (column >= 0) & (column < self._side)
        cell = (ring * self._side + column)[found]
        return np.bincount(cell, minlength=self._side**2).astype(np.float64)

    def integrals(self, density: Density, points: int) -> tuple[Float, Float]:
        """(side²,) the density's integral over each part by so many points, and its variance."""
        side = self._side
        u = np.random.default_rng(0).random((2, side, side, points))
        z = self._z[:-1, None, None] + u[0] * np.diff(self._z)[:, None, None]
        width = np.diff(self._phi)
        phi = self._phi[:, :-1, None] + u[1] * width[..., None]
        s = np.sqrt(np.maximum(1.0 - z * z, 0.0))
        local = np.stack([s * np.cos(phi), s * np.sin(phi), z], -1)
        q = density((local.reshape(-1, 3) @ self._basis).astype(np.float32)).astype(np.float64)
        solid_angle = (np.diff(self._z)[:, None] * width).ravel()
        q = q.reshape(-1, points)
        return solid_angle * q.mean(1), solid_angle**2 * q.var(1) / points


def agreement(
    drawn: NDArray[np.floating], total: int, density: Density, *, side: int = 10, points: int = 4096
) -> float:
    """p-value of the hypothesis that directions were drawn with a density.

    Parameters
    ----------
    drawn : (N, 3)
        Those of `total` independent draws that count; the others, and what the bins leave out, make
        up one more bin, whose share is what the density's integral lacks of 1.
    density : callable
        Its integrals over the bins are known up to the scatter of so many `points` each, which is
        allowed for.
    """
    # Bins from one half of the draws, counts from the other: the edges are no fit to the counts.
    pilot, counted, total = drawn[::2], drawn[1::2], total // 2
    bins = Bins(pilot, side)
    counts = bins.counts(counted)
    share, scatter = bins.integrals(density, points)
    share, scatter = np.append(share, 1.0 - share.sum()), np.append(scatter, scatter.sum())
    counts = np.append(counts, total - counts.sum())
    expected, variance = share * total, scatter * total**2
    # Small bins become one.
    small = expected < 25.0
    expected, variance, counts = (
        np.append(a[~small], a[small].sum()) for a in (expected, variance, counts)
    )
    variance += np.maximum(expected, 1.0)
    return float(chi2.sf(((counts - expected) ** 2 / variance).sum(), len(counts) - 1))
