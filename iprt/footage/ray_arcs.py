"""Rays as arcs of great circles on the panorama."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.equirect import cell_towards

Floats = NDArray[np.float32]


class RayArcs:
    """Arcs that rays follow as seen from the capture centre, from origin to direction.

    By the sine rule, the distance from the centre at the angle φ from the origin is
    r sin Φ / sin(Φ - φ), with r the distance of the origin and Φ the angle between origin and
    direction.

    Parameters
    ----------
    start : (n, 3) float64
        Origins, in metres from the capture centre.
    direction : (n, 3) float64
        Unit vectors.

    Attributes
    ----------
    whole : (n,) float32
        Φ, in radians.
    """

    def __init__(self, start: NDArray[np.float64], direction: NDArray[np.float64]) -> None:
        way = direction.astype(np.float32)
        self._distance = np.linalg.norm(start, axis=-1).astype(np.float32)
        first = (start / self._distance[:, None]).astype(np.float32)
        cosine = np.clip(np.einsum("ij,ij->i", first, way), -1.0, 1.0)
        self.whole, self._sine = np.arccos(cosine), np.sqrt(np.maximum(1.0 - cosine**2, 1e-12))
        square = (way - cosine[:, None] * first) / self._sine[:, None]
        # Separate coordinates: NumPy takes several times as long on arrays of three.
        self._ahead, self._aside = (np.ascontiguousarray(p.T)[:, None] for p in (first, square))

    def behind(self, angle: Floats, depth: Floats, rows: int) -> tuple[Floats, NDArray[np.intp]]:
        """Return how far rays at angles (k, n) are behind surfaces, over depth; and the cells.

        `depth` (2 `rows`²,) are the depths of cells, in metres.
        """
        point = np.cos(angle) * self._ahead + np.sin(angle) * self._aside
        unit = np.ones(angle.shape, np.float32)
        cell = cell_towards(np.moveaxis(point, 0, -1), unit, rows)
        sine = np.maximum(np.sin(self.whole - angle), np.float32(1e-6))
        reach = self._distance * self._sine / sine
        return reach / depth[cell] - np.float32(1.0), cell
