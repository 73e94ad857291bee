"""Tangent planes of a panorama and their joints, computed from depth on the device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.footage.normals import Tap, window_taps
from iprt.world.real.pyramid import equirect_centres, equirect_edges

BAND_TEXELS = 2**19
"""Texels, about, in the rows processed at a time: intermediate buffers stay in caches."""
MARGIN = constant("lib/world/real/tangent.h", "MARGIN")
LANES = constant("lib/maths/lanes.h", "WIDE_LANES")
"""Texels per work item where vectors are wide."""
TAP = np.dtype([("scale", "f4"), ("a", "f4"), ("b", "f4"), ("line", "i4")])
"""`Tap` of `cl/world/real/planes.cl`."""


@dataclass(frozen=True)
class Lines:
    """Layout of a panorama's rows in a buffer, each continued by the reach of windows.

    Attributes
    ----------
    table : (H, 4) int32
        Index of column 0; columns that the line continues to the left, and to the right; 0.
    taps : (H, 25) TAP
        Window of each row.
    size : int
        Floats of the buffer.
    """

    table: NDArray[np.int32]
    taps: NDArray[Any]
    size: int

    @classmethod
    def of(cls, width: int, height: int) -> Lines:
        """Return the lines of a panorama of this size."""
        taps = window_taps(width, height)
        beyond = np.full((2, height), 2)
        for tap in taps:
            np.maximum.at(beyond[0], tap.row, -tap.columns)
            np.maximum.at(beyond[1], tap.row, tap.columns)
        ends = np.cumsum(beyond.sum(axis=0) + width)
        start = ends - width - beyond[1]
        table = np.zeros((height, 4), np.int32)
        table[:, 0], table[:, 1], table[:, 2] = start, *beyond
        return cls(table, _packed(taps, start), int(ends[-1]) + LANES)


def _packed(taps: list[Tap], start: NDArray[np.intp]) -> NDArray[Any]:
    packed = np.zeros((start.size, len(taps)), TAP)
    for number, tap in enumerate(taps):
        packed["scale"][:, number], packed["a"][:, number] = tap.scale, tap.a
        packed["b"][:, number], packed["line"][:, number] = tap.b, start[tap.row] + tap.columns
    return packed


class Surfaces:
    """Tangent planes of a panorama (`cl/world/real/inverse.cl`, `planes.cl`, `surface.cl`).

    Attributes
    ----------
    width, height : int
    inverse : (size,) float32
        Inverse depth in the lines of `lines`; openings have the sign bit.
    lines : (H, 4) int32
        `Lines.table`.
    surface : (H, W, 4) float32
        Tangent plane and flags per texel, see `cl/lib/world/real/real.h`.
    grid : dict
        Size, edges and centres of columns and rows, as kernels take them.
    """

    def __init__(self, device: ComputeDevice, width: int, height: int) -> None:
        self._device = device
        self.width, self.height = width, height
        self._band = band_rows(height, width)
        self._stride = -(-width // LANES) * LANES
        lines = Lines.of(width, height)
        self.lines = device.upload("panorama.lines", lines.table)
        self.inverse = device.zeros("panorama.inverse", (lines.size,))
        self.surface = device.empty("panorama.surface", (height, width, 4))
        self._depth = device.empty("panorama.depth", (self._band, width))
        self._marks = device.empty("panorama.marks", (self._band, width), np.uint8)
        self._normal: cla.Array | None = None
        floats = 3 * (self._band + 2) * self._stride
        self._planes = device.zeros("panorama.planes", (floats + 2 * MARGIN,))
        column, row = equirect_edges(width, height)
        azimuth, polar = equirect_centres(width, height)
        self.grid = {
            "width": width,
            "height": height,
            "column": device.upload("panorama.column", column),
            "row": device.upload("panorama.row", row),
            "azimuth": device.upload("panorama.azimuth", azimuth),
            "polar": device.upload("panorama.polar", polar),
        }
        size = {"width": width, "height": height, "stride": self._stride}
        wide = {"WIDE": device.wide}
        edges = self._stride + LANES
        self._invert = device.kernel("world/real/inverse.cl", "invert_depth").fixed(
            width=width,
            rows=self._band,
            depth=self._depth,
            marks=self._marks,
            lines=self.lines,
            inverse=self.inverse,
        )
        along = {
            "azimuth": device.upload("panorama.azimuths", _images(azimuth, self._stride)),
            "polar": self.grid["polar"],
            "planes": self._planes,
            "lines": self.lines,
            "inverse": self.inverse,
        }
        self._fit = device.kernel("world/real/planes.cl", "fit_planes", wide).fixed(
            size,
            along,
            rows=self._band + 2,
            taps=device.upload("panorama.taps", lines.taps.view(np.float32)),
        )
        self._take = device.kernel("world/real/planes.cl", "take_planes", wide).fixed(
            size, along, rows=self._band + 2, azimuth=self.grid["azimuth"]
        )
        self._build = device.kernel("world/real/surface.cl", "build_surface", wide).fixed(
            size,
            along,
            rows=self._band,
            edges=edges,
            column=device.upload("panorama.columns", _images(column, edges)),
            row=self.grid["row"],
            surface=self.surface,
        )

    def load(
        self,
        depth: NDArray[np.float32],
        opening: NDArray[np.bool_],
        normal: NDArray[np.float32] | None,
        tolerance: float,
        range_: cla.Array,
    ) -> None:
        """Fill `inverse`, `surface`, and level 0 of the pyramid `range_`.

        Parameters
        ----------
        depth, opening, normal
            As in `Frame`.
        tolerance : float
            `Frame.fit_tolerance`.
        range_ : (cells, 2) float32
            `Panorama.range`.
        """
        device, band = self._device, self._band
        marks = opening.view(np.uint8)
        for first in bands(self.height, self.width):
            rows = slice(first, first + band)
            device.write(self._depth, depth[rows])
            device.write(self._marks, marks[rows])
            self._invert((self.width, band), first=first)
        for first in bands(self.height, self.width):
            # One more row beyond either end, to join the rows at the ends with.
            self._fit(self.items(band + 2), first=first - 1, tolerance=tolerance)
            if normal is not None:
                self._take_given(normal, first - 1)
            fitted = int(normal is None)
            self._build(self.items(band), first=first, fitted=fitted, range=range_)

    def items(self, rows: int) -> tuple[int, int]:
        """Return the work items, over some rows, of kernels built with WIDE."""
        return -(-self.width // LANES) if self._device.wide else self.width, rows

    def _take_given(self, normal: NDArray[np.float32], first: int) -> None:
        """Replace planes of the rows from `first` on by planes of given normals."""
        device, rows = self._device, self._band + 2
        if self._normal is None:
            self._normal = device.empty("panorama.normal", (rows, self.width, 3))
        given = np.zeros(self._normal.shape, np.float32)
        low, high = max(first, 0), min(first + rows, self.height)
        given[low - first : high - first] = normal[low:high]
        device.write(self._normal, given)
        self._take((self.width, rows), first=first, normals=self._normal)


def band_rows(height: int, width: int) -> int:
    """Return the number of rows in a band."""
    return min(max(BAND_TEXELS // width, 1), height)


def bands(height: int, width: int) -> list[int]:
    """Return the first rows of the bands of equal size; the last may overlap the one before."""
    rows = band_rows(height, width)
    return [min(first, height - rows) for first in range(0, height, rows)]


def _images(pairs: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Return two lines of `size` from pairs (N, 2), with padding for a work item's texels."""
    images = np.zeros((2, size), np.float32)
    images[:, : len(pairs)] = pairs.T
    return np.pad(images.ravel(), (MARGIN, LANES))
