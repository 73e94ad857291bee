"""Brightness of a sun from frame to frame, by the borders of its patches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.cells import Cells, Float, Geometry
from iprt.footage.found_sun.receivers import Receivers
from iprt.footage.frame import LUMINANCE, Frame

ROWS, STEPS = 256, 200
"""Rows of cells in large enough frames, and points at which rays are tested."""
MOST_PAIRS, MIN_PAIRS = 200, 8
"""Bounds on the number of pairs of cells."""
MARGINS = (3, 2, 1)
"""Numbers of cells beside a border that are left out, in the order in which they are tried."""
NEIGHBOURS = 8
"""Number of shaded cells that are tried for each lit one."""
SAME_NORMAL, SAME_PLANE, NEAR = 0.97, 0.03, np.deg2rad(15.0)
"""Least cosine of the normals of a pair, largest distance across the surface relative to depth, and
largest angle between them."""
MIN_CONTRAST = 0.3
"""Least radiance of a lit cell over the shaded one's, less 1."""
SAMPLES = 4
"""Texels along each side of a cell whose mean counts."""
MOST = 1.5
"""Largest brightness relative to the first frame's."""


@dataclass(frozen=True)
class SunPatches:
    """Pairs of cells on one surface, in the sun and in the shade beside it.

    The quotient of their radiance is (E + S cos) / E. Less 1, it is in proportion to the sun's
    irradiance S, whatever the camera's exposure is.

    Attributes
    ----------
    rows : int
        Rows of cells.
    lit, shaded : (n,) int64
        Numbers of cells.
    contrast : (n,) float64
        Quotient of radiance, less 1, in the first frame.
    """

    rows: int
    lit: NDArray[np.int64]
    shaded: NDArray[np.int64]
    contrast: Float

    @classmethod
    def of(cls, frame: Frame, direction: Float) -> Self | None:
        """Return the pairs that the first frame shows; None if they are too few.

        `direction` (3,) is a unit vector towards the sun, in the axes of the capture centre.
        """
        rows = min(ROWS, frame.height)
        cells = Cells.of(Geometry.of(frame, rows), rows)
        receivers = Receivers.of(frame, cells, cells, STEPS)
        pairs = border_pairs(receivers, direction)
        if pairs is None:
            return None
        return cls(rows, *pairs, contrast=_contrast(frame.color, rows, *pairs))

    def share(self, color: NDArray[np.float32]) -> float:
        """Return the sun's brightness in a picture (H, W, 3), relative to the first frame's."""
        now = _contrast(color, self.rows, self.lit, self.shaded) / self.contrast
        return float(np.clip(np.median(now), 0.0, MOST))


def border_pairs(
    receivers: Receivers, direction: Float
) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Return cells (n,) in the sun, and for each one in the shade nearby, on the same plane.

    Cells near a border may be on either side. They are left out: as many of them as leave enough
    pairs. Returns None if there are too few in any case.

    Parameters
    ----------
    receivers : Receivers
    direction : (3,) float64
        Unit vector towards the sun.
    """
    bright, (_, weight) = receivers.color @ LUMINANCE, receivers.facing(direction)
    is_lit, faces = receivers.lit(direction) > 0.0, weight > 0.0
    for margin in MARGINS:
        inner = (_inner(side, receivers.cells.rows, margin) & faces for side in (is_lit, ~is_lit))
        lit, shaded = _pairs(receivers.cells, *inner)
        clear = bright[lit] > (1.0 + MIN_CONTRAST) * bright[shaded]
        if np.count_nonzero(clear) >= MIN_PAIRS:
            return lit[clear], shaded[clear]
    return None


def _pairs(
    cells: Cells, is_lit: NDArray[np.bool_], is_shaded: NDArray[np.bool_]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return lit cells (n,), and for each a shaded one nearby on the same plane."""
    bright, dark = np.flatnonzero(is_lit), np.flatnonzero(is_shaded)
    if len(dark) < NEIGHBOURS:
        return bright[:0], dark[:0]
    bright = bright[:: -(-len(bright) // MOST_PAIRS) or 1]
    chord = 2.0 * np.sin(0.5 * NEAR)
    tree = scipy.spatial.cKDTree(cells.direction[dark])
    apart, index = tree.query(cells.direction[bright], NEIGHBOURS)
    other, normal = dark[index], cells.normal[bright]
    like = np.einsum("ijk,ik->ij", cells.normal[other], normal) > SAME_NORMAL
    across = np.einsum("ijk,ik->ij", cells.point[other] - cells.point[bright][:, None], normal)
    fits = like & (np.abs(across) < SAME_PLANE * cells.depth[bright][:, None]) & (apart < chord)
    there = fits.any(axis=1)
    return bright[there], other[np.arange(len(bright)), fits.argmax(axis=1)][there]


def _inner(inside: NDArray[np.bool_], rows: int, margin: int) -> NDArray[np.bool_]:
    """Return the cells (N,) of a set that are farther than some cells from others."""
    wrapped = np.pad(inside.reshape(rows, -1), ((0, 0), (margin, margin)), mode="wrap")
    eroded = scipy.ndimage.binary_erosion(
        wrapped, np.ones((3, 3)), iterations=margin, border_value=1
    )
    return np.asarray(eroded[:, margin:-margin].ravel())


def _contrast(
    color: NDArray[np.float32], rows: int, lit: NDArray[np.int64], shaded: NDArray[np.int64]
) -> Float:
    """Return the quotients (n,) of radiance of pairs of cells, less 1, in a picture of any size."""
    bright, dark = (
        color[_texels(cells, rows, color.shape)].mean(axis=(1, 2)) for cells in (lit, shaded)
    )
    return np.asarray((bright @ LUMINANCE) / np.maximum(dark @ LUMINANCE, 1e-30) - 1.0, np.float64)


def _texels(
    cells: NDArray[np.int64], rows: int, shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows (n, SAMPLES, 1) and columns (n, 1, SAMPLES) of texels in cells (n,)."""
    within = (np.arange(SAMPLES) + 0.5) / SAMPLES
    row, column = (
        ((at[:, None] + within) * (size / count)).astype(np.int64)
        for at, size, count in zip(
            np.divmod(cells, 2 * rows), shape[:2], (rows, 2 * rows), strict=True
        )
    )
    return row[:, :, None], column[:, None, :]
