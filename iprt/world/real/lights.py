"""Table for light sampling: rays aimed at the bright parts of the panorama."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.block import Block, Float2, Floats, Int32, Ints
from iprt.device.compute import ComputeDevice
from iprt.device.vectors import float2
from iprt.geometry.equirect import solid_angles

LIGHT_ROWS = 256
"""Most rows of the table: cells of 0.7 degrees."""


@dataclass(kw_only=True)
class LightsArgs(Block):
    """Light sampling table (`cl/lib/world/real/lights.h`); by default empty.

    Attributes
    ----------
    cumulative : (count + 1,) float32
        Cumulative probabilities of the listed cells.
    cell : (count,) int32
        row * columns + column.
    density : (rows * columns,) float32
        1/sr about the capture centre.
    count : int
        0: the panorama is too even to aim at anything.
    columns, rows : int
    size : float2
        Columns and rows: see `GridArgs`.
    """

    cumulative: Floats = None
    cell: Ints = None
    density: Floats = None
    count: Int32 = 0
    columns: Int32 = 1
    rows: Int32 = 1
    size: Float2 = None

    def __post_init__(self) -> None:
        self.size = float2(self.columns, self.rows)


class Lights:
    """Densities of directions about the capture centre, for `cl/lib/world/real/lights.h`.

    Attributes
    ----------
    rows, columns : int
    count : int
        Cells with a positive density; 0 where the panorama is even.
    luminance : (rows, columns) float32
        Means over the cells.
    """

    def __init__(
        self, device: ComputeDevice, width: int, height: int, *, name: str = "light"
    ) -> None:
        self._device = device
        self.rows, self.columns = min(LIGHT_ROWS, height), min(2 * LIGHT_ROWS, width)
        cells = self.rows * self.columns
        self._cumulative = device.zeros(f"{name} cumulative", (cells + 1,))
        self._cell = device.zeros(f"{name} cells", (cells,), np.int32)
        self._density = device.zeros(f"{name} density", (cells,))
        self.luminance = device.empty(f"{name} luminance", (self.rows, self.columns))
        wide = {"WIDE": device.wide}
        self._sum = device.kernel("world/real/pictures.cl", "sum_luminance", wide).fixed(
            columns=self.columns, rows=self.rows, mean=self.luminance
        )
        self.count = 0

    def load(self, radiance: cla.Array, hidden: cla.Array | None = None) -> None:
        """Build the table of a panorama (H, W, 4), linear radiance.

        `hidden` (H, W) is the luminance of lights in the hidden background, else 0.
        """
        height, width, _ = radiance.shape
        self._sum(
            (self.columns, self.rows),
            width=width,
            height=height,
            texels=radiance,
            hidden_light=hidden,
        )
        density, cells, cumulative = light_table(self._device.read(self.luminance))
        self.count = len(cells)
        padded = np.zeros(self._cumulative.shape, np.float32)
        padded[: self.count + 1] = cumulative
        numbers = np.zeros(self._cell.shape, np.int32)
        numbers[: self.count] = cells
        self._device.write(self._cumulative, padded)
        self._device.write(self._cell, numbers)
        self._device.write(self._density, density.astype(np.float32))

    def arguments(self) -> LightsArgs:
        """Return the table for rays."""
        return LightsArgs(
            cumulative=self._cumulative,
            cell=self._cell,
            density=self._density,
            count=self.count,
            columns=self.columns,
            rows=self.rows,
        )


def light_table(
    luminance: NDArray[np.floating],
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Return sampling densities proportional to the excess of cells' luminance over the mean.

    BRDF sampling is better for even light, so the mean is subtracted (*MIS compensation*, Karlík et
    al., "MIS Compensation: Optimizing Sampling Techniques in Multiple Importance Sampling",
    SIGGRAPH Asia 2019).

    Parameters
    ----------
    luminance : (rows, columns)
        Means over the cells of an equirect grid.

    Returns
    -------
    density : (rows * columns,) float64
        1/sr about the capture centre; sums to 1 over the sphere, or is 0 everywhere.
    cells : (N,) int32
        Cells of positive density.
    cumulative : (N + 1,) float64
        Cumulative probabilities, from 0 to 1.
    """
    rows, columns = luminance.shape
    mean = luminance.astype(np.float64).ravel()
    solid_angle = np.repeat(solid_angles(columns, rows), columns)
    average = float((mean * solid_angle).sum() / (4.0 * np.pi))
    # Rounding errors are not light: an even panorama gives 0.
    excess = np.where(mean > average * (1.0 + 1e-4), mean - average, 0.0)
    total = float((excess * solid_angle).sum())
    cells = np.flatnonzero(excess).astype(np.int32)
    if not total > 0.0:
        return np.zeros(rows * columns), cells[:0], np.zeros(1)
    density = excess / total
    cumulative = np.concatenate([[0.0], np.cumsum((density * solid_angle)[cells])])
    return density, cells, cumulative / cumulative[-1]
