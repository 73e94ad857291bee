"""Classification of texels without depth: windows, open sky, or gaps in a surface.

A *hole* is a connected set of texels without depth (8-neighbours, across the seam and over the
poles). There are three kinds:

- **Open sky**: a hole that no rim closes. It covers more than 2 sr, or it holds the zenith and
  reaches down to 30° above the horizon (a street's sky; a skylight ends higher). It stays infinite.
- **Opening**: any other hole, usually a window. It is filled from its rim, and flagged.
- **Dropout**: a gap that a sensor left in a surface. It is smaller than 1e-4 sr and less than twice
  as bright as its rim, or holds the nadir, where the tripod stands, or is marked as a surface. It
  is filled from its rim, and not flagged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.footage.components import component_of
from iprt.footage.frame import LUMINANCE
from iprt.footage.video.depth_code import UNMEASURED, usable
from iprt.geometry.equirect import solid_angles

OPEN_SKY_SR = 2.0
"""Solid angle above which a hole is open. It is below 2 pi, so that the fill is unique."""
OPEN_SKY_ELEVATION_DEG = 30.0
DROPOUT_SR = 1e-4
DROPOUT_BRIGHTNESS = 2.0

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Holes:
    """Texels without depth by kind; all (H, W) bool and disjoint."""

    open_sky: Mask
    opening: Mask
    dropout: Mask


def holes_of(stored: NDArray[np.float32], measured: Mask, color: NDArray[np.float32]) -> Holes:
    """Classify the texels that are not `measured`; see `classify_holes`."""
    return HoleFinder()(stored, measured, color)


def classify_holes(hole: Mask, color: NDArray[np.float32], unmeasured: Mask | None = None) -> Holes:
    """Sort holes into open sky, openings and dropouts, by the rules of this module.

    Parameters
    ----------
    hole : (H, W) bool
        Texels without depth.
    color : (H, W, 3) float32
        Linear radiance, finite.
    unmeasured : (H, W) bool or None
        Texels marked as surfaces. Holes mostly marked count as surfaces.
    """
    marked = np.zeros_like(hole) if unmeasured is None else unmeasured
    return _Outlines(hole, marked[hole]).kinds(color)


class HoleFinder:
    """Classification of a video's holes, whose outlines are kept while they stay."""

    def __init__(self) -> None:
        self._outlines: _Outlines | None = None

    def __call__(
        self, stored: NDArray[np.float32], measured: Mask, color: NDArray[np.float32]
    ) -> Holes:
        """Classify the texels of depth (H, W) in metres that are not `measured`."""
        last = self._outlines
        if last is None or not np.array_equal(last.measured, measured):
            hole = ~measured
            last = _Outlines(hole, stored[hole] == UNMEASURED)
        else:
            marked = stored.ravel()[last.texel] == UNMEASURED
            if not np.array_equal(marked, last.marked):
                last = _Outlines(~measured, marked)
        self._outlines = last
        return last.kinds(color)

    def openings(self, stored: NDArray[np.float32], color: NDArray[np.float32]) -> Mask:
        """Find the openings (H, W) of depth in metres, with its color (H, W, 3)."""
        measured = usable(stored)
        if measured.all():
            return np.zeros_like(measured)
        return self(stored, measured, color).opening


class _Outlines:
    """Holes (H, W), and evidence from their shapes; `marked` are the surfaces among texels."""

    def __init__(self, hole: Mask, marked: Mask) -> None:
        height, width = hole.shape
        self.hole, self.measured, self.marked = hole, ~hole, marked
        self.texel = np.flatnonzero(hole)
        self.of_texel, self.count = component_of(hole, self.texel)
        of_texel, count, rows = self.of_texel, self.count, self.texel // width
        sr = np.bincount(of_texel, solid_angles(width, height)[rows], minlength=count)
        lowest_row = np.zeros(count)
        # Texels are in the order of their rows, so the last assignment stays.
        lowest_row[of_texel] = rows
        elevation_deg = 90.0 - 180.0 * (lowest_row + 1.0) / height
        at_zenith, at_nadir = (
            np.isin(np.arange(count), of_texel[rows == row]) for row in (0, height - 1)
        )
        said = np.bincount(of_texel, marked, minlength=count)
        is_surface = said > 0.5 * np.bincount(of_texel, minlength=count)
        reaches_down = at_zenith & (elevation_deg < OPEN_SKY_ELEVATION_DEG)
        self._open = (sr > OPEN_SKY_SR) | (reaches_down & ~is_surface)
        self._dropout = ~self._open & (at_nadir | is_surface)
        # The others of these are openings if they are bright.
        self._small = ~self._open & ~self._dropout & (sr < DROPOUT_SR)
        self._kinds: tuple[Mask, Holes] | None = None

    def kinds(self, color: NDArray[np.float32]) -> Holes:
        """Return the holes by kind, with the colors (H, W, 3) of a frame."""
        is_dropout = self._dropout
        if self._small.any():
            chosen = self._small[self.of_texel]
            brightness = _brightness_over_rim(
                self.hole, color, self.texel[chosen], self.of_texel[chosen], self.count
            )
            is_dropout = is_dropout | (self._small & (brightness < DROPOUT_BRIGHTNESS))
        if self._kinds is None or not np.array_equal(self._kinds[0], is_dropout):
            masks = self._open, ~self._open & ~is_dropout, is_dropout
            self._kinds = is_dropout, Holes(*map(self._texels, masks))
        return self._kinds[1]

    def _texels(self, chosen: Mask) -> Mask:
        mask = np.zeros_like(self.hole)
        mask.ravel()[self.texel] = chosen[self.of_texel]
        return mask


def _brightness_over_rim(
    hole: Mask,
    color: NDArray[np.float32],
    texel: NDArray[np.intp],
    of_texel: NDArray[np.intp],
    count: int,
) -> NDArray[np.float64]:
    """Return (count,) mean luminance of holes relative to the texels around; 0 without a rim."""
    height, width = hole.shape
    colors, holes = color.reshape(-1, 3), hole.ravel()
    rows, columns = np.divmod(texel, width)
    total = np.bincount(of_texel, colors[texel] @ LUMINANCE, minlength=count)
    inside = total / np.maximum(np.bincount(of_texel, minlength=count), 1)
    rim_sum, rim_count = np.zeros(count), np.zeros(count)
    for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        row, column = rows + down, (columns + right) % width
        there = (row >= 0) & (row < height)
        other, own = (row * width + column)[there], of_texel[there]
        outside = ~holes[other]
        other, own = other[outside], own[outside]
        rim_sum += np.bincount(own, colors[other] @ LUMINANCE, minlength=count)
        rim_count += np.bincount(own, minlength=count)
    rim = rim_sum / np.maximum(rim_count, 1)
    return np.where(rim_count > 0, inside / np.maximum(rim, 1e-12), 0.0)
