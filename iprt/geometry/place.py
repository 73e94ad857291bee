"""Places of maps that lie elsewhere than the mesh's texture coordinates say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Coefficients = tuple[tuple[float, float, float], tuple[float, float, float]]
IDENTITY: Coefficients = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
"""Affine map of texture coordinates that leaves them as they are."""


@dataclass(frozen=True)
class Place:
    """Texture coordinates of a map of a material.

    Attributes
    ----------
    matrix : (2, 3) float
        Affine map of the mesh's texture coordinates to the map's, v up.
    second : bool
        It applies to `Mesh.uvs2` instead of `Mesh.uvs`.
    """

    matrix: Coefficients = IDENTITY
    second: bool = False

    def coordinates(
        self, uvs: NDArray[np.floating], uvs2: NDArray[np.floating] | None
    ) -> NDArray[np.float64]:
        """Return the map's coordinates (V, 2) of vertices with `Mesh.uvs` and `Mesh.uvs2`."""
        given = uvs2 if self.second else uvs
        assert given is not None
        matrix = np.array(self.matrix)
        return np.asarray(given @ matrix[:, :2].T + matrix[:, 2], np.float64)

    @property
    def scale(self) -> float:
        """Factor of lengths on the map: the root of the factor of areas."""
        (a, b, _), (c, d, _) = self.matrix
        return float(np.sqrt(abs(a * d - b * c)))


Places = tuple[Place | None, Place | None, Place | None, Place | None]
"""Places of the maps of surface, normals, emission and the clear coat's normals.

None: as the mesh's `uvs`.
"""
ALL_ALIKE: Places = (None, None, None, None)


def upright(matrix: Coefficients) -> Coefficients:
    """Return a map of coordinates with v down as one with v up, or the reverse."""
    (a, b, right), (c, d, down) = matrix
    return (a, -b, b + right), (-c, d, 1.0 - d - down)


def relative(base: Coefficients, matrix: Coefficients) -> Place | None:
    """Return the place by `matrix` of coordinates to which `base` has been applied.

    None where `base` has no inverse, because all coordinates fall onto a line.
    """
    first, second = (np.array([*rows, (0.0, 0.0, 1.0)]) for rows in (base, matrix))
    with np.errstate(all="ignore"):
        if not abs(np.linalg.det(first)) > np.finfo(np.float32).tiny:
            return None
        (a, b, c), (d, e, f), _ = (second @ np.linalg.inv(first)).tolist()
    found = (a, b, c), (d, e, f)
    return Place(found) if np.isfinite(found).all() else None
