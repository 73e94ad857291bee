"""Limit on computed highlights from the captured picture.

The light that a glossy floor reflects towards the capture centre may lie outside its view. Above
all this is the sky above a window's upper edge, which is extrapolated
(`iprt.footage.window_environment`) and may be several times too bright, or of another hue. The
captured picture of the highlight limits it. A surface of one material is assumed to have everywhere
at least the diffuse reflectance of its darker parts. Captured radiance beyond that bounds the
highlight.
"""

from __future__ import annotations

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant

FILE = "world/real/highlight_gain.cl"
DIGITS = 3
"""Digits of a quantile: its relative error is at most 2^-16."""


class HighlightGain:
    """Factors on computed highlights, and least remainders without them, per cell.

    Attributes
    ----------
    gain : (rows, columns, 4) float32
        In [0, 1]; 1 where no cell nearby has gloss. The fourth is 0.
    min_base : (rows, columns, 4) float32
        Radiance that the highlight leaves wherever the captured radiance reaches it.

    Parameters
    ----------
    rows, columns : int
        Cells of the panorama.
    table : (rows, 4) float32
        `material_table()` of the real materials.
    materials : int
        Their count.
    """

    def __init__(
        self, device: ComputeDevice, rows: int, columns: int, table: cla.Array, materials: int
    ) -> None:
        self._device, self._items = device, 3 * materials
        self._first_row = self._row_count = 0
        cells = (rows, columns, 4)
        self.gain = device.empty("highlight gain", cells)
        self.min_base = device.empty("highlight floor", cells)
        bins = constant(FILE, "DIGIT")
        self._counts = device.empty("highlight cells", (materials, 2), np.uint32)
        self._bins = device.empty(
            "highlight histograms", (DIGITS, self._items, 1 << bins), np.uint32
        )
        known = {
            "columns": columns,
            "rows": rows,
            "items": self._items,
            "real_materials": table,
            "counts": self._counts,
            "bins": self._bins,
            "chosen": device.empty("highlight quantiles' bits", (self._items, 2), np.uint32),
            "quantile": device.empty("highlight quantiles", (materials, 4)),
            "across": device.empty("highlight averages", (3, *cells)),
            "gain": self.gain,
            "min_base": self.min_base,
            # They are overwritten at the end.
            "smooth": self.min_base,
            "reflectance": self.gain,
        }
        self._size = (columns, rows)
        self._measure, self._count, self._choose, self._average, self._limit = (
            device.kernel(FILE, name).fixed(known)
            for name in (
                "measure_reflectance",
                "count_bins",
                "choose_bins",
                "average_across",
                "limit_highlight",
            )
        )

    def place(self, rows: NDArray[np.bool_]) -> None:
        """Set which rows of cells have gloss."""
        glossy = np.flatnonzero(rows)
        self._first_row = int(glossy[0]) if len(glossy) else 0
        self._row_count = int(glossy[-1]) + 1 - self._first_row if len(glossy) else 0

    def run(self, seen: cla.Array, specular: cla.Array, irradiance: cla.Array) -> None:
        """Fill `gain` and `min_base`.

        Parameters
        ----------
        seen, specular : (rows, columns, 4) float32
            Means over a cell's glossy texels: captured radiance, computed highlight. The fourth
            channel of `seen` is the index of their material + 1; 0: the cell has none.
        irradiance : (rows, columns, 4) float32
            Over π, with the noise of few rays: averaged over 3 x 3 cells of the same material.
        """
        first = {"first_row": self._first_row}
        means = {"seen": seen, "specular": specular}
        size = (self._size[0], self._row_count)
        if self._row_count:
            self._device.fill_zero(self._counts)
            self._device.fill_zero(self._bins)
            self._measure(size, first, means, irradiance=irradiance)
            for digit in range(DIGITS):
                self._count(size, first, digit=digit)
                self._choose((self._items,), digit=digit)
            self._average(size, first, means)
        self._limit(self._size, first, row_count=self._row_count)
