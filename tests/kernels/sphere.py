"""Whether directions are drawn with the density that is stated for them: chi-square tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

Float = NDArray[np.float64]


def basis(axis: Float) -> Float:
    """(3, 3) rows x, y, z: right-handed, z the unit vector `axis`."""
    axis = axis / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis])


def cap_directions(
    axis: Float, cosine: float, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.float32], float]:
    """At least `count` directions (N, 3), one at random in each of equal parts of the cap whose rim
    is at `cosine` from the axis; and the solid angle of each.
    """
    side = int(np.ceil(np.sqrt(count)))
    i, j = np.meshgrid(np.arange(side), np.arange(side))
    u, v = (np.stack([i, j]).reshape(2, -1) + rng.random((2, side * side))) / side
    z, phi = 1.0 - u * (1.0 - cosine), 2.0 * np.pi * v
    s = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    local = np.stack([s * np.cos(phi), s * np.sin(phi), z], -1)
    return (local @ basis(axis)).astype(np.float32), 2.0 * np.pi * (1.0 - cosine) / side**2


class Bins:
    """Parts of the sphere about an axis, as fine as `pilot` directions (N, 3) are dense."""

    def __init__(self, pilot: NDArray[np.floating], axis: Float, side: int = 20) -> None:
        self._basis = basis(axis)
        theta, phi = self._angles(pilot)
        inner = np.linspace(0.0, 1.0, side + 1)[1:-1]
        self._theta = np.concatenate([[-1.0], np.quantile(theta, inner), [4.0]])
        self._phi = np.concatenate([[-4.0], np.quantile(phi, inner), [4.0]])

    def _angles(self, d: NDArray[np.floating]) -> tuple[Float, Float]:
        x, y, z = (d.astype(np.float64) @ self._basis.T).T
        return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)

    def sums(self, d: NDArray[np.floating], weights: Float | None = None) -> Float:
        """(side²,) sum of the weights of the directions (N, 3) in each bin."""
        bins = (self._theta, self._phi)
        return np.asarray(np.histogram2d(*self._angles(d), bins=bins, weights=weights)[0].ravel())


def agreement(
    drawn: NDArray[np.floating],
    total: int,
    reference: NDArray[np.floating],
    density: NDArray[np.floating],
    solid_angle: float,
    axis: Float,
) -> float:
    """p-value of the hypothesis that directions were drawn with a density.

    Parameters
    ----------
    drawn : (N, 3)
        Those of `total` independent draws that count; the others make up one more bin.
    reference, density : (M, 3), (M,)
        The density at directions of `solid_angle` each (`cap_directions`), which cover all where it
        is positive. Its integral over a bin is known up to their scatter, which is allowed for.
    """
    pilot, counted, total = drawn[::2], drawn[1::2], total // 2
    bins = Bins(pilot, axis)
    counts = bins.sums(counted)
    q = density.astype(np.float64) * solid_angle
    number = np.maximum(bins.sums(reference), 1.0)
    share = bins.sums(reference, q)
    scatter = np.maximum(bins.sums(reference, q * q) - share**2 / number, 0.0)
    share, scatter = np.append(share, 1.0 - share.sum()), np.append(scatter, scatter.sum())
    counts = np.append(counts, total - counts.sum())
    # Small bins become one.
    small = share * total < 25.0
    pooled = [np.append(a[~small], a[small].sum()) for a in (share, scatter, counts)]
    expected, scatter, counts = pooled[0] * total, pooled[1] * total**2, pooled[2]
    kept = expected > 5.0
    variance = np.maximum(expected, 0.0) + scatter
    statistic = ((counts - expected) ** 2 / variance)[kept].sum()
    assert counts[~kept].sum() <= 25.0, "drawn where the density is zero"
    return float(chi2.sf(statistic, np.count_nonzero(kept) - 1))
