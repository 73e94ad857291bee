"""Gaussian means over the sphere, of values in equirect cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.equirect import texel_polar_angles

Floats = NDArray[np.float32]


class LocalMean:
    """Weighted sums of values around each cell, with a Gaussian of the angle between cells.

    The weight of cells at the angle γ is exp((cos γ - 1) / σ²). All rows are convolved along
    azimuth by Fourier transforms, so that nothing changes at ±180° or near the poles.

    Parameters
    ----------
    rows : int
        Rows of cells, half the number of columns.
    width : float
        Standard deviation σ, in radians.
    """

    def __init__(self, rows: int, width: float) -> None:
        self._rows = rows
        polar = texel_polar_angles(rows)
        azimuth = np.arange(2 * rows) * np.pi / rows
        cosine = np.cos(polar)[:, None, None] * np.cos(polar)[:, None]
        cosine = cosine + np.sin(polar)[:, None, None] * np.sin(polar)[:, None] * np.cos(azimuth)
        weight = np.exp((cosine - 1.0) / width**2)
        # Even in azimuth: the transform is real.
        self._weight = np.fft.rfft(weight, axis=-1).real.transpose(2, 0, 1).astype(np.float32)

    def sums(self, values: Floats) -> Floats:
        """Return the weighted sums (N, D) around cells, of values (N, D) in cells, row by row."""
        count = values.shape[1]
        there = np.fft.rfft(values.reshape(self._rows, -1, count), axis=1).transpose(1, 0, 2)
        both = np.concatenate([there.real, there.imag], axis=-1).astype(np.float32)
        found = self._weight @ both
        summed = (found[..., :count] + 1j * found[..., count:]).transpose(1, 0, 2)
        around = np.fft.irfft(summed, n=2 * self._rows, axis=1)
        return around.reshape(-1, count).astype(np.float32)

    def __call__(self, values: Floats, weights: Floats) -> Floats:
        """Return the means (N, D) of values with weights, both (N, D); 0 where weights vanish."""
        total = self.sums(weights)
        return np.asarray(self.sums(weights * values) / np.maximum(total, np.float32(1e-12)))
