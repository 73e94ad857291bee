"""Tangent planes of a panorama and their joints, computed from depth on the device."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl.array as cla
from numpy.typing import NDArray

from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant
from iprt.footage.normals import WINDOW_REACH, Tap, column_spread, window_taps
from iprt.world.real.changed_surfaces import Mask, changed_tiles, runs, span_of, tile_side, widened
from iprt.world.real.pyramid import equirect_centres, equirect_edges

BAND_TEXELS = 2**19
"""Texels, about, in the rows processed at a time: intermediate buffers stay in caches."""
REACH = WINDOW_REACH + 1
"""Rows beyond a change in which planes, or the neighbours' that they are joined with, differ."""
MARGIN = constant("lib/world/real/tangent.h", "MARGIN")
LANES = constant("lib/maths/lanes.h", "WIDE_LANES")
"""Texels per work item where vectors are wide."""
TAP = np.dtype([("scale", "f4"), ("a", "f4"), ("b", "f4"), ("line", "i4")])
"""`Tap` of `cl/world/real/planes.cl`."""
Given = tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.float32] | None, float]
"""Depth, openings, normals and tolerance of a frame."""


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
        Inverse depth in the lines of `lines`, until `release`; openings have the sign bit.
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
        self._given: Given | None = None
        self._inverted = False
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
            taps=device.upload("panorama.taps", lines.taps.view(np.float32)),
        )
        self._take = device.kernel("world/real/planes.cl", "take_planes", wide).fixed(
            size, along, azimuth=self.grid["azimuth"]
        )
        self._build = device.kernel("world/real/surface.cl", "build_surface", wide).fixed(
            size,
            along,
            edges=edges,
            column=device.upload("panorama.columns", _images(column, edges)),
            row=self.grid["row"],
            surface=self.surface,
        )

    @property
    def given(self) -> Given | None:
        """Depth, openings, normals and tolerance of the loaded frame."""
        return self._given

    def load(
        self,
        depth: NDArray[np.float32],
        opening: NDArray[np.bool_],
        normal: NDArray[np.float32] | None,
        tolerance: float,
        range_: cla.Array,
    ) -> tuple[Mask | None, Mask, slice]:
        """Fill `inverse`, `surface`, and level 0 of the pyramid `range_`.

        Rows far from all changes since the last frame stay as they are.

        Parameters
        ----------
        depth, opening, normal
            As in `Frame`; they must not change afterwards.
        tolerance : float
            `Frame.fit_tolerance`.
        range_ : (cells, 2) float32
            `Panorama.range`, the same each time.

        Returns
        -------
        tiles : (rows, columns) bool or None
            Tiles whose depth, openings or normals have changed; None: all.
        rows : (H,) bool
            Rows in which `surface` may have changed.
        columns : slice
            Columns in which it may have changed.
        """
        device = self._device
        given = depth, opening, normal, tolerance
        tiles, self._given = self._changed(given), given
        marks = opening.view(np.uint8)
        rows = np.ones(self.height, bool)
        if tiles is not None:
            rows = tiles.any(axis=1).repeat(tile_side(self.height))[: self.height]
        stale = rows if self._inverted else np.ones(self.height, bool)
        self._inverted = True
        for first, count in self._pieces(stale):
            part = slice(first, first + count)
            device.write(self._depth[:count], depth[part])
            device.write(self._marks[:count], marks[part])
            self._invert((self.width, count), first=first, rows=count)
        reached = widened(rows, REACH)
        columns = self._columns(tiles, reached)
        wide = self._beside(columns)
        for first, count in self._pieces(reached):
            # One more row, and texel, beyond either end, to join those at the ends with.
            beyond = {"first": first - 1, "rows": count + 2, "left": wide.start}
            self._fit(self._items(wide, count + 2), beyond, tolerance=tolerance)
            if normal is not None:
                self._take_given(normal, first - 1, count + 2)
            own = {"first": first, "rows": count, "left": columns.start}
            size = self._items(columns, count)
            self._build(size, own, fitted=int(normal is None), range=range_)
        return tiles, reached, columns

    def release(self) -> None:
        """Wait, and give back the memory of `inverse`, which the next `load` fills again."""
        self._device.discard(self.inverse)
        self._inverted = False

    def _columns(self, tiles: Mask | None, rows: Mask) -> slice:
        """Return the columns in which `surface` may change; all if the seam is among them."""
        if tiles is None or not rows.any():
            return slice(0, self.width)
        side = tile_side(self.height)
        span = span_of(np.asarray(tiles.any(axis=0)))
        reach = REACH * int(column_spread(self.width, self.height)[rows].max())
        low, high = span.start * side - reach, span.stop * side + reach
        high = low + -(-(high - low) // LANES) * LANES
        inside = low >= LANES and high + LANES <= self.width
        return slice(low, high) if inside else slice(0, self.width)

    def _beside(self, columns: slice) -> slice:
        """Return columns with a vector's more at either end, if these are not all."""
        if columns.stop - columns.start >= self.width:
            return columns
        return slice(columns.start - LANES, columns.stop + LANES)

    def _changed(self, given: Given) -> Mask | None:
        """Return tiles in which the frame's depth, openings or normals differ from the last's."""
        if self._given is None:
            return None
        depth, opening, normal, tolerance = self._given
        if tolerance != given[3]:
            return None
        tiles = changed_tiles(depth, given[0]) | changed_tiles(opening, given[1])
        if normal is None or given[2] is None:
            return tiles if normal is given[2] else None
        return np.asarray(tiles | changed_tiles(normal, given[2]), bool)

    def _pieces(self, rows: Mask) -> Iterator[tuple[int, int]]:
        """Yield first row and number of rows, at most a band, of runs of True in `rows` (H,)."""
        for run in runs(rows):
            for first in range(run.start, run.stop, self._band) if rows[run.start] else ():
                yield first, min(self._band, run.stop - first)

    def _items(self, columns: slice, rows: int) -> tuple[int, int]:
        """Return the work items of these columns, as in `items`."""
        width = columns.stop - columns.start
        return -(-width // LANES) if self._device.wide else width, rows

    def items(self, rows: int) -> tuple[int, int]:
        """Return the work items, over some rows, of kernels built with WIDE."""
        return self._items(slice(0, self.width), rows)

    def _take_given(self, normal: NDArray[np.float32], first: int, rows: int) -> None:
        """Replace planes of `rows` rows from `first` on by planes of given normals."""
        device = self._device
        if self._normal is None:
            self._normal = device.empty("panorama.normal", (self._band + 2, self.width, 3))
        given = np.zeros((rows, self.width, 3), np.float32)
        low, high = max(first, 0), min(first + rows, self.height)
        given[low - first : high - first] = normal[low:high]
        device.write(self._normal[:rows], given)
        self._take((self.width, rows), first=first, rows=rows, normals=self._normal)


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
