"""Gaussian means over a subset of a panorama's cells."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.cells import Float


class MeansAround:
    """A Gaussian filter that takes means over n cells only.

    It filters only the rows and columns that contain these cells, as products with sparse matrices.
    This spends no time on the rest of the panorama, and starts no competing BLAS threads.

    Parameters
    ----------
    rows : int
        Number of rows of the grid of cells (rows, 2 rows).
    on : (n,) int
        Indices of the cells.
    """

    def __init__(self, rows: int, on: NDArray[np.intp]) -> None:
        self._rows = rows
        row, column = np.divmod(on, 2 * rows)
        self._down, self._row = np.unique(row, return_inverse=True)
        self._across, self._column = np.unique(column, return_inverse=True)

    def __call__(self, parts: Float, kept: NDArray[np.bool_], deviation: float) -> Float:
        """Average K quantities over the cells that are kept.

        Parameters
        ----------
        parts : (K, n, C) float64
        kept : (n,) bool
        deviation : float
            Standard deviation of the Gaussian, in cells.

        Returns
        -------
        (K, n, C) float64
            Means; 0 where no cell nearby is kept.
        """
        means = np.zeros(parts.shape)
        filled = parts.any(axis=(1, 2))
        columns = np.moveaxis(parts[filled], 0, 1).reshape(len(kept), -1)
        sums = np.zeros((len(self._down), len(self._across), columns.shape[1] + 1))
        at = self._row[kept], self._column[kept]
        sums[*at, :-1] = columns[kept]
        sums[*at, -1] = 1.0
        sums = _filtered(sums, _gaussian(self._rows, deviation, "nearest"), self._down)
        sums = np.swapaxes(sums, 0, 1)
        sums = _filtered(sums, _gaussian(2 * self._rows, deviation, "wrap"), self._across)
        found = sums[self._column, self._row]
        found = found[:, :-1] / np.maximum(found[:, -1:], 1e-9)
        means[filled] = np.moveaxis(found.reshape(len(kept), -1, parts.shape[-1]), 1, 0)
        return means


def _filtered(sums: Float, matrix: scipy.sparse.csr_array, used: NDArray[np.intp]) -> Float:
    """Multiply sums (k, ...) by the rows and columns `used` (k,) of a matrix."""
    matrix = matrix[used][:, used]
    return np.asarray((matrix @ sums.reshape(len(sums), -1)).reshape(sums.shape))


@lru_cache(maxsize=32)
def _gaussian(
    size: int, deviation: float, mode: Literal["nearest", "wrap"]
) -> scipy.sparse.csr_array:
    """Return the matrix (size, size) of a Gaussian filter."""
    return scipy.sparse.csr_array(
        scipy.ndimage.gaussian_filter1d(np.eye(size), deviation, axis=0, mode=mode)
    )
