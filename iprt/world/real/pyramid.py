"""Min/max depth pyramids over the panorama and over the layers of the virtual objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.block import Block, Counters, Float2, Float2s, Floats, Int32, when
from iprt.device.compute import ComputeDevice
from iprt.device.vectors import float2
from iprt.geometry.equirect import texel_azimuths, texel_polar_angles


@dataclass(kw_only=True)
class GridArgs(Block):
    """Min/max pyramid over an equirect image, or over a view, that rays march through.

    Level l has ceil(width / 2^l) x ceil(height / 2^l) cells. Cells of the last rows and columns are
    clipped at width and height.

    Attributes
    ----------
    width, height : int
    size : float2
        Width and height. GPUs would keep conversions of these in registers along each ray.
    levels : int
        The coarsest cells span at most π/4 of azimuth.
    range : (cells, 2) float32
        (min, max) radial distance in metres per cell, level after level.
    column : (width + 1, 2) float32 or None
        (cos, sin) of the azimuth of column edges; None in perspective views.
    row : (height + 1,) float32 or None
        cos of the polar angle of row edges; None in perspective views.
    """

    width: Int32
    height: Int32
    levels: Int32
    range: Float2s
    column: Float2s
    row: Floats
    size: Float2 = None
    work: Counters = when("COUNT_WORK", outer="work_counters")

    def __post_init__(self) -> None:
        self.size = float2(self.width, self.height)


@dataclass(frozen=True)
class PyramidShape:
    """Sizes of the levels of a pyramid, finest first.

    Attributes
    ----------
    columns, rows : tuple of int
        Cells per level, `ceil(size / 2**level)`.
    """

    columns: tuple[int, ...]
    rows: tuple[int, ...]

    @classmethod
    def of(cls, width: int, height: int, coarsest_columns: int) -> PyramidShape:
        """Return levels, halved until the next would have fewer than `coarsest_columns` columns."""
        columns, rows = [width], [height]
        while columns[-1] > 1 and (columns[-1] + 1) // 2 >= coarsest_columns:
            columns.append((columns[-1] + 1) // 2)
            rows.append((rows[-1] + 1) // 2)
        return cls(tuple(columns), tuple(rows))

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(self.columns)

    @property
    def offsets(self) -> tuple[int, ...]:
        """First cell of each level in the concatenated buffer, with the total as last entry."""
        sizes = np.multiply(self.columns, self.rows)
        return tuple(int(n) for n in np.concatenate([[0], np.cumsum(sizes)]))


class Pyramid:
    """Kernel that builds the coarser levels in place over a filled finest level."""

    def __init__(self, device: ComputeDevice) -> None:
        self._reduce = device.kernel("world/real/pyramid.cl", "reduce_range")

    def run(self, range_: cla.Array, shape: PyramidShape, rows: slice = slice(None)) -> None:
        """Fill levels 1 and up of `range_`, (cells, 2) float32, from level 0.

        `rows` are the rows of level 0 outside of which coarser levels are filled already.
        """
        first, end, _ = rows.indices(shape.rows[0])
        for level in range(shape.levels - 1 if first < end else 0):
            first, end = first // 2, (end + 1) // 2
            self._reduce(
                (shape.columns[level + 1], end - first),
                columns=shape.columns[level],
                rows=shape.rows[level],
                fine=shape.offsets[level],
                coarse=shape.offsets[level + 1],
                first=first,
                count=end - first,
                range=range_,
            )


def equirect_edges(width: int, height: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the edges of an equirect image's texels, for the marches of `cl/lib/maths/grid.h`.

    Returns
    -------
    column : (width + 1, 2) float32
        Cosine and sine of the azimuth of the column edges; the last equals the first exactly.
    row : (height + 1,) float32
        Cosine of the polar angle of the row edges, from 1 to -1.
    """
    phi = (np.arange(width + 1) / width - 0.5) * 2.0 * np.pi
    column = np.stack([np.cos(phi), np.sin(phi)], axis=-1).astype(np.float32)
    column[-1] = column[0]
    row = np.cos(np.arange(height + 1) / height * np.pi).astype(np.float32)
    return column, row


def equirect_centres(width: int, height: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return cosine and sine of texel centres' azimuths (width, 2) and polar angles (height, 2)."""
    phi, theta = texel_azimuths(width), texel_polar_angles(height)
    azimuth = np.stack([np.cos(phi), np.sin(phi)], axis=-1).astype(np.float32)
    polar = np.stack([np.cos(theta), np.sin(theta)], axis=-1).astype(np.float32)
    return azimuth, polar
