"""Directions in which a video's surfaces change from frame to frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.footage.differences import differing
from iprt.geometry.equirect import texel_directions

Mask = NDArray[np.bool_]

TILE_ROWS = 64
"""Most rows of tiles in which changes are found: 2.8 degrees each."""
MOST_CONES = 16
"""Most cones that rays are compared with; of more changes, everything counts as changed."""
REACH = 8
"""Texels from a change at which rays may begin elsewhere, in its block or cell of the gain."""
MOST_CHANGED = 0.25
"""Share of changed tiles above which comparing rays does not pay."""


def changed_tiles(before: NDArray[Any], now: NDArray[Any]) -> Mask:
    """Return the tiles (rows, columns) of two pictures that differ; see `differing`."""
    height, width = now.shape[:2]
    tiles = np.zeros(tile_shape(height, width), bool)
    if before is now:
        return tiles
    side = tile_side(height)
    words = np.uint32 if now.itemsize == 4 else np.uint8
    for row, first in enumerate(range(0, height, side)):
        old, new = (picture[first : first + side] for picture in (before, now))
        if not np.array_equal(old.view(words), new.view(words)):
            columns = differing(old, new).any(axis=0)
            tiles[row] = np.logical_or.reduceat(columns, np.arange(0, width, side))
    return tiles


def tile_side(height: int) -> int:
    """Return the side of a tile in texels."""
    return -(-height // TILE_ROWS)


def tile_shape(height: int, width: int) -> tuple[int, int]:
    """Return rows and columns of tiles."""
    side = tile_side(height)
    return -(-height // side), -(-width // side)


def runs(flags: Mask) -> list[slice]:
    """Return the runs of equal flags (N,), in order."""
    starts = np.flatnonzero(np.diff(flags, prepend=~flags[:1]))
    ends = [*starts[1:], len(flags)]
    return [slice(int(first), int(end)) for first, end in zip(starts, ends, strict=True)]


def span_of(flags: Mask) -> slice:
    """Return the slice from the first to the last set flag (N,); empty if none is."""
    found = np.flatnonzero(flags)
    return slice(int(found[0]), int(found[-1]) + 1) if len(found) else slice(0, 0)


def widened(flags: Mask, reach: int = 1) -> Mask:
    """Return flags (N,) that are also set up to `reach` places beside a set one."""
    near = np.convolve(flags, np.ones(2 * reach + 1, np.intp))
    return np.asarray(near[reach : reach + len(flags)] > 0)


class ChangedSurfaces:
    """Tiles whose surfaces have changed since they were last looked at.

    Parameters
    ----------
    width, height : int
        Size of the panorama.
    """

    def __init__(self, width: int, height: int) -> None:
        self._tiles = np.ones(tile_shape(height, width), bool)
        self._reach = -(-REACH // tile_side(height))

    def add(self, tiles: Mask | None) -> None:
        """Add changed tiles; None: all of them."""
        self._tiles |= True if tiles is None else tiles

    def taken(self) -> NDArray[np.float32] | None:
        """Return cones around the changed tiles, and begin a new list.

        Returns
        -------
        (N, 4) float32 or None
            Axis, and cosine of half the angle, which is at most a right one. Tiles within `REACH`
            of a changed one are inside, at least those beside it. None: everywhere.
        """
        tiles, self._tiles = self._tiles, np.zeros_like(self._tiles)
        if tiles.mean() > MOST_CHANGED:
            return None
        reach = self._reach
        around = np.pad(tiles, ((0, 0), (reach, reach)), mode="wrap")
        box = np.ones((3, 3))
        wide = scipy.ndimage.binary_dilation(around, box, iterations=reach)[:, reach:-reach]
        # A group across the seam counts as two.
        groups, count = scipy.ndimage.label(wide, box)
        if count > MOST_CONES:
            return None
        rows, columns = tiles.shape
        centre = np.stack(np.broadcast_arrays(*texel_directions(columns, rows)), axis=-1)
        cones = np.zeros((count, 4), np.float32)
        for number, cone in enumerate(cones):
            directions = centre[groups == number + 1]
            mean = directions.mean(axis=0)
            size = np.linalg.norm(mean)
            axis = mean / size if size > 0.0 else np.array((0.0, 1.0, 0.0))
            farthest = np.arccos(np.clip((directions @ axis).min(), -1.0, 1.0))
            # Corners are up to 0.75 rows from their tile's centre.
            angle = farthest + 0.75 * np.pi / rows
            if angle >= 0.5 * np.pi:
                return None
            cone[:] = *axis, np.cos(angle)
        return cones
